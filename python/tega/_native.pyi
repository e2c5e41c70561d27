"""Typed face of the extension module; proved by `python -m mypy.stubtest tega._native`."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

__version__: Final[str]

# --- tactile ---

_Contact = tuple[float, tuple[float, float], float, float, int, float, float, tuple[int, int], bool]

def contact_metrics(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    *,
    weights: tuple[float, float, float],
    order: str,
    difference: str,
    spread: str,
    factor: float,
    centroid_value: str,
    gate: tuple[float, int] | None,
) -> _Contact: ...
def read_contact(
    frame: NDArray[np.uint8], baseline: NDArray[np.uint8], *, reading: str, order: str
) -> _Contact: ...

# --- haptics ---

# --- emg ---

# --- hand ---

# --- wire ---
