"""Find device drivers by name, and define the protocols that they meet."""

from __future__ import annotations

from tega.devices.base import (
    ArmDriver,
    Device,
    DeviceInfo,
    DiscoveringDevice,
    EmgChunk,
    EmgSource,
    Found,
    HandDriver,
    HarmlessDevice,
    InputEvent,
    InputReading,
    InputSource,
    Options,
    SkippingSource,
    SteeredHand,
    TactileFrame,
    TactileSource,
    Tracker,
    VestSink,
)
from tega.devices.registry import DriverRecord, driver_class, driver_names, list_drivers
from tega.runtime.lifecycle import Opened, require

__all__ = [
    "ArmDriver",
    "Device",
    "DeviceInfo",
    "DiscoveringDevice",
    "DriverRecord",
    "EmgChunk",
    "EmgSource",
    "Found",
    "HandDriver",
    "HarmlessDevice",
    "InputEvent",
    "InputReading",
    "InputSource",
    "Opened",
    "Options",
    "SkippingSource",
    "SteeredHand",
    "TactileFrame",
    "TactileSource",
    "Tracker",
    "VestSink",
    "driver_class",
    "driver_names",
    "list_drivers",
    "require",
]
