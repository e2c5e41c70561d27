"""Compare readings of touch, EMG and vest on recordings, with the stages that a run uses.

The paper's threshold mixes pixels with grey values, its difference image has no stated sign, its vote has no rule for
ties, and its law is not linear; each way of reading a place is a set of settings, applied to the same recording.
"""

from __future__ import annotations

from tega_figures.audit.emg import EmgScore
from tega_figures.audit.recordings import EmgColumns
from tega_figures.audit.run import Audited, AuditReport, AuditRequest, audit_recording
from tega_figures.audit.touch import FingerAudit, TouchScore, mean_difference
from tega_figures.audit.truth import Forces, Mark, read_forces, read_marks
from tega_figures.audit.variants import READINGS, Kind, SettingSweep, parse_sweep
from tega_figures.audit.vest import VestScore

__all__ = [
    "READINGS",
    "AuditReport",
    "AuditRequest",
    "Audited",
    "EmgColumns",
    "EmgScore",
    "FingerAudit",
    "Forces",
    "Kind",
    "Mark",
    "SettingSweep",
    "TouchScore",
    "VestScore",
    "audit_recording",
    "mean_difference",
    "parse_sweep",
    "read_forces",
    "read_marks",
]
