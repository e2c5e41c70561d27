"""Simulate the person at the task: perception, decisions, muscles, EMG. Labelled as simulated."""

from tega.runtime.keys import Keys
from tega_sim.operator.acting import Operator
from tega_sim.operator.emg import CHANNELS, Calibrated, ForearmEmg, calibrate
from tega_sim.operator.emg_noise import EFFECTS, TICK_HZ
from tega_sim.operator.person import (
    Parameters,
    PersonNumbers,
    clear_skin,
    draw_person,
    load_parameters,
    people_digest,
    typical_person,
)
from tega_sim.operator.scripted import KEYS_HELP, KeyboardOperator, ScriptedOperator
from tega_sim.operator.vision import VIEWS, ViewName

__all__ = [
    "CHANNELS",
    "EFFECTS",
    "KEYS_HELP",
    "TICK_HZ",
    "VIEWS",
    "Calibrated",
    "ForearmEmg",
    "KeyboardOperator",
    "Keys",
    "Operator",
    "Parameters",
    "PersonNumbers",
    "ScriptedOperator",
    "ViewName",
    "calibrate",
    "clear_skin",
    "draw_person",
    "load_parameters",
    "people_digest",
    "typical_person",
]
