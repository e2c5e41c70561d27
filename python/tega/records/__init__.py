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
from tega.records.beside import BesideContact, BesideIntent
from tega.records.emg import EmgSamples, Intent
from tega.records.hand import BusFrame, HandCommand, HandExchange, Imposed, Joints, bus_frames
from tega.records.latency import Latency
from tega.records.operator import Button, InputState
from tega.records.run import (
    Alert,
    End,
    Haptics,
    HeardMarker,
    LogLine,
    Marker,
    RecorderStatus,
    RunState,
    Skip,
    Value,
)
from tega.records.touch import Contact, Event, NamedValue, Picture
from tega.records.vest import SentFrame, TriedMotor, VestFrame, VestRecord

__all__ = [
    "RECORDS",
    "Alert",
    "ArmHealth",
    "ArmMeasured",
    "ArmSent",
    "ArmTarget",
    "ArmTurn",
    "BesideContact",
    "BesideIntent",
    "BusFrame",
    "Button",
    "Contact",
    "EmgSamples",
    "End",
    "Event",
    "ForearmPose",
    "HandCommand",
    "HandExchange",
    "Haptics",
    "HeardMarker",
    "Imposed",
    "InputState",
    "Intent",
    "Joints",
    "Latency",
    "LogLine",
    "Marker",
    "NamedValue",
    "Picture",
    "PoseNumbers",
    "PoseRecord",
    "Record",
    "RecorderStatus",
    "RunState",
    "SentFrame",
    "Skip",
    "TrackerAxes",
    "TriedMotor",
    "Value",
    "VestFrame",
    "VestRecord",
    "bus_frames",
]

RECORDS: tuple[type[Record], ...] = (
    Picture,
    Contact,
    EmgSamples,
    Intent,
    VestFrame,
    SentFrame,
    HandCommand,
    HandExchange,
    Imposed,
    Joints,
    RunState,
    Alert,
    Marker,
    HeardMarker,
    InputState,
    Button,
    Skip,
    Haptics,
    Value,
    Latency,
    End,
    LogLine,
    RecorderStatus,
    ArmTurn,
    ArmHealth,
    ForearmPose,
    ArmMeasured,
    ArmTarget,
    ArmSent,
    TrackerAxes,
    BesideContact,
    BesideIntent,
    Event,
    TriedMotor,
)
"""All of them."""
