"""Simulate the person at the task: perception, decisions, muscles, EMG. Labelled as simulated."""

from tega.sim.operator.acting import Operator
from tega.sim.operator.calibrate import Calibrated, calibrate
from tega.sim.operator.effects import EFFECTS
from tega.sim.operator.emg import CHANNELS, ForearmEmg
from tega.sim.operator.emg_noise import TICK_HZ
from tega.sim.operator.keyboard import KEYS_HELP, KeyboardOperator
from tega.sim.operator.keys import Keys
from tega.sim.operator.person import (
    Parameters,
    PersonNumbers,
    clear_skin,
    draw_person,
    load_parameters,
    typical_person,
)
from tega.sim.operator.rules import Rules, RulesVersion, people_digest
from tega.sim.operator.scripted import ScriptedOperator
from tega.sim.operator.shams import SHAMS, Sham, sham_vest
from tega.sim.operator.vision import VIEWS, ViewName

__all__ = [
    "CHANNELS",
    "EFFECTS",
    "KEYS_HELP",
    "SHAMS",
    "TICK_HZ",
    "VIEWS",
    "Calibrated",
    "ForearmEmg",
    "KeyboardOperator",
    "Keys",
    "Operator",
    "Parameters",
    "PersonNumbers",
    "Rules",
    "RulesVersion",
    "ScriptedOperator",
    "Sham",
    "ViewName",
    "calibrate",
    "clear_skin",
    "draw_person",
    "load_parameters",
    "people_digest",
    "sham_vest",
    "typical_person",
]
