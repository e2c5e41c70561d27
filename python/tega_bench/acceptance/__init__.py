"""Lead through a device's first hour: identity, rate, latency, limits, one least motion, and stop.

Everything goes through the driver that a run would use. Motions and sensations have the least strength, and need a
person's confirmation first; :func:`accept_device` makes the report.
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
