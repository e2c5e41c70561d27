"""Steer a robot hand by EMG and feel its fingertips on a vest: TEGA, the tactile-enhanced grasping assistant.

Touch flows ``tactile → haptics → wire``, intent flows ``emg → hand → wire``. The modules are loaded on first
use, so that ``import tega`` costs nothing.

Example:
    >>> import tega
    >>> tega.emg.fuse_levels([2, 2, 5])
    2
"""

from __future__ import annotations

import importlib
from types import ModuleType

__all__ = [
    "__version__",
    "config",
    "devices",
    "emg",
    "errors",
    "hand",
    "haptics",
    "loop",
    "tactile",
    "wire",
]

_MODULES = frozenset(__all__) - {"__version__"}


def __getattr__(name: str) -> ModuleType | str:
    if name in _MODULES:
        return importlib.import_module(f"tega.{name}")
    if name == "__version__":
        from tega._native import __version__

        return __version__
    raise AttributeError(f"module 'tega' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
