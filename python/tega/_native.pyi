"""Typed face of the extension module; proved by `python -m mypy.stubtest tega._native`."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

__version__: Final[str]

# --- tactile ---

# --- haptics ---

FINGERS: Final[list[str]]
HIGH_SHARE: Final[float]

def logistic_intensity(value: float, maximum: float, /, *, end_value: float) -> float: ...
def linear_intensity(value: float, maximum: float, /) -> float: ...
def contact_type(cci_norm: float, eda_norm: float, /) -> str: ...
def vest_intensities(
    front: tuple[float, float, float, float],
    back: tuple[float, float, float, float],
    /,
    *,
    layout: str,
    mirror: str,
) -> NDArray[np.uint8]: ...
def layout_motors(layout: str, /) -> NDArray[np.uint8]: ...
def vest_levels(layout: str, intensities: NDArray[np.uint8], /) -> NDArray[np.uint8]: ...
def vest_x40(layout: str, intensities: NDArray[np.uint8], /) -> NDArray[np.uint8]: ...

# --- emg ---

# --- hand ---

# --- wire ---
