"""Run a study in silico: simulated people go through a plan on the simulated bench; all of it is simulated."""

from tega_study.silico.assumptions import Assumptions, read_assumptions
from tega_study.silico.simulate import ensure_plan, simulate, unfinished

__all__ = ["Assumptions", "ensure_plan", "read_assumptions", "simulate", "unfinished"]
