"""Lead through a device's first hour: who it is, how fast, how late, its limits, one least motion, and its stop.

Everything goes through the driver that a run would use. What is felt or moves does so at the least strength, after a
person has said yes; :func:`accept_device` makes the report.
"""

from __future__ import annotations

from tega_bench.acceptance.report import AcceptanceReport, AcceptanceStep, report_text, write_report
from tega_bench.acceptance.run import accept_device, acceptance_case

__all__ = [
    "AcceptanceReport",
    "AcceptanceStep",
    "accept_device",
    "acceptance_case",
    "report_text",
    "write_report",
]
