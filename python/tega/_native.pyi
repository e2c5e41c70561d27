"""Typed face of the extension module; proved by `python -m mypy.stubtest tega._native`."""

from typing import Final

__version__: Final[str]

# --- tactile ---

# --- haptics ---

# --- emg ---

# --- hand ---

# --- wire ---
