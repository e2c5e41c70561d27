"""Run the two loops: touch back to the wearer, intent forward to the hand."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tega.loop.loop import DualLoop
    from tega.loop.pacing import LoopReport
    from tega.loop.session import run_session
    from tega.loop.snapshot import LoopView, Snapshot
    from tega.loop.touch import TouchLoop

__all__ = ["DualLoop", "LoopReport", "LoopView", "Snapshot", "TouchLoop", "run_session"]

# Loaded when they are asked for: a run opens its devices before it needs most of it.
_PLACES = {
    "DualLoop": "loop",
    "LoopReport": "pacing",
    "LoopView": "snapshot",
    "Snapshot": "snapshot",
    "TouchLoop": "touch",
    "run_session": "session",
}


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(importlib.import_module(f"tega.loop.{_PLACES[name]}"), name)
    raise AttributeError(f"module 'tega.loop' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
