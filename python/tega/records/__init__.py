"""Define the records that pass through a run, each as one typed struct with topic, units and version."""

from __future__ import annotations

from tega.records.arm import (
    ArmHealth,
    ArmMeasured,
    ArmSent,
    ArmTarget,
    ArmTurn,
    ForearmPose,
    PoseNumbers,
    PoseRecord,
    TrackerAxes,
)
from tega.records.base import Record
from tega.records.emg import Adaptation, AdaptationSwitch, BesideIntent, EmgSamples, Intent, MuscleCondition
from tega.records.outputs import (
    BusFrame,
    HandCommand,
    HandExchange,
    HandLook,
    Imposed,
    Joints,
    ProgramFrame,
    ReflexGrip,
    SentFrame,
    TriedMotor,
    VestFrame,
    VestRecord,
    bus_frames,
)
from tega.records.run import (
    Alert,
    Button,
    End,
    Haptics,
    HeardMarker,
    InputState,
    Latency,
    LogLine,
    Marker,
    RecorderStatus,
    RunState,
    Skip,
    Value,
)
from tega.records.touch import BesideContact, Contact, Event, NamedValue, Picture

__all__ = [
    "RECORDS", "Adaptation", "AdaptationSwitch", "Alert", "ArmHealth", "ArmMeasured", "ArmSent",
    "ArmTarget", "ArmTurn", "BesideContact", "BesideIntent", "BusFrame", "Button", "Contact",
    "EmgSamples", "End", "Event", "ForearmPose", "HandCommand", "HandExchange", "HandLook", "Haptics",
    "HeardMarker", "Imposed", "InputState", "Intent", "Joints", "Latency", "LogLine", "Marker",
    "MuscleCondition", "NamedValue", "Picture", "PoseNumbers", "PoseRecord", "ProgramFrame", "Record",
    "RecorderStatus", "ReflexGrip", "RunState", "SentFrame", "Skip", "TrackerAxes", "TriedMotor", "Value",
    "VestFrame", "VestRecord", "bus_frames",
]  # fmt: skip

RECORDS: tuple[type[Record], ...] = (
    Picture, Contact, EmgSamples, Intent, VestFrame, SentFrame, HandCommand, HandExchange, Imposed,
    Joints, RunState, Alert, Marker, HeardMarker, InputState, Button, Skip, Haptics, Value, Latency, End,
    LogLine, RecorderStatus, ArmTurn, ArmHealth, ForearmPose, ArmMeasured, ArmTarget, ArmSent,
    TrackerAxes, BesideContact, BesideIntent, Event, TriedMotor, ProgramFrame, AdaptationSwitch,
    Adaptation, MuscleCondition, ReflexGrip, HandLook,
)  # fmt: skip
"""All of them."""
