"""Diagnose the problems of a bench, with causes and remedies.

Without settings the four devices of the paper are searched for. With settings exactly their devices are opened
through the drivers, read for a moment and closed. Nothing here moves a hand or lets a vest vibrate.
"""

from __future__ import annotations

from tega.setup.doctor.bench import probe_all, probe_drivers
from tega.setup.doctor.findings import Examination, Finding, Status
from tega.setup.doctor.lab_file import lab_settings, udev_rules
from tega.setup.doctor.settings import examine

__all__ = [
    "Examination",
    "Finding",
    "Status",
    "examine",
    "lab_settings",
    "probe_all",
    "probe_drivers",
    "udev_rules",
]
