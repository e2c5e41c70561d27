"""Steer a robot hand by EMG and feel its fingertips on a vest: TEGA, the tactile-enhanced grasping assistant.

Touch flows ``tactile → haptics → wire``, intent flows ``emg → hand → wire``. The modules are loaded on first
use, so that ``import tega`` costs nothing.

Example:
    >>> import tega
    >>> tega.emg.fuse_levels([2, 2, 5])
    2
    >>> tega.open_recording("examples/recorded-lift")["/touch/event"][0].kind
    'contact'
"""

from __future__ import annotations

import importlib
from typing import Any

__all__ = [
    "__version__",
    "config",
    "devices",
    "emg",
    "errors",
    "hand",
    "haptics",
    "loop",
    "open_recording",
    "plot",
    "records",
    "session",
    "stages",
    "tactile",
    "wire",
]

# Names that are no module of the package, and their modules.
_PLACES = {
    "__version__": "tega._native",
    "open_recording": "tega.recording.opened",
    "session": "tega.loop.program",
}


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(importlib.import_module(_PLACES[name]), name)
    if name in __all__:
        return importlib.import_module(f"tega.{name}")
    raise AttributeError(f"module 'tega' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
