"""Run the two loops: touch back to the wearer, intent forward to the hand."""

from __future__ import annotations

from tega.teleop.loop import DualLoop
from tega.teleop.loop_report import LoopReport
from tega.teleop.moment import LoopView, Moment
from tega.teleop.session import run_session
from tega.teleop.touch import TouchLoop, TouchMoment

__all__ = ["DualLoop", "LoopReport", "LoopView", "Moment", "TouchLoop", "TouchMoment", "run_session"]
