"""Exchange metrics, decoders, mappings, reflexes and layouts without touching TEGA, through entry points.

A stage is a class (a layout: an object) in any installed package, registered under one of five entry-point groups and
chosen by its name in the settings. See ``docs/own-stage.md``.
"""

from tega.haptics.motor_layout import Motor, MotorLayout, find_layout
from tega.records import Contact, Event, Intent, NamedValue
from tega.stages.base import (
    Decoder,
    FingerSetup,
    GelTraits,
    Mapping,
    MeasuredPicture,
    Metric,
    MuscleSetup,
    Reflex,
    ReflexSetup,
    StageOptions,
    TouchMap,
    VestSetup,
)
from tega.stages.registry import StageRecord, list_stages, stage_class, stage_names

__all__ = [
    "Contact",
    "Decoder",
    "Event",
    "FingerSetup",
    "GelTraits",
    "Intent",
    "Mapping",
    "MeasuredPicture",
    "Metric",
    "Motor",
    "MotorLayout",
    "MuscleSetup",
    "NamedValue",
    "Reflex",
    "ReflexSetup",
    "StageOptions",
    "StageRecord",
    "TouchMap",
    "VestSetup",
    "find_layout",
    "list_stages",
    "stage_class",
    "stage_names",
]
