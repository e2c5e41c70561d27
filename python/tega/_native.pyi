"""Typed face of the extension module; proved by `python -m mypy.stubtest tega._native`."""

from collections.abc import Sequence
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray

__all__: list[str]
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
    frame: NDArray[np.uint8], baseline: NDArray[np.uint8], *, reading: str, order: str, outline: str
) -> _Contact: ...
def contact_mask(
    frame: NDArray[np.uint8], baseline: NDArray[np.uint8], *, reading: str, order: str, outline: str
) -> NDArray[np.bool_]: ...
def pressure_map(
    frame: NDArray[np.uint8], baseline: NDArray[np.uint8], *, reading: str, order: str, outline: str
) -> NDArray[np.float32]: ...

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

@final
class ButterworthLowpass:
    def __new__(cls, rate_hz: float, cutoff_hz: float, order: int, channels: int) -> ButterworthLowpass: ...
    def process(self, samples: NDArray[np.float64]) -> NDArray[np.float64]: ...
    @property
    def channels(self) -> int: ...
    @property
    def sos(self) -> NDArray[np.float64]: ...
    @property
    def held_samples(self) -> NDArray[np.uint64]: ...

@final
class BlockMean:
    def __new__(cls, tau: int, channels: int | None) -> BlockMean: ...
    def process(self, samples: NDArray[np.float64]) -> NDArray[np.float64]: ...
    @property
    def channels(self) -> int | None: ...
    @property
    def held_samples(self) -> NDArray[np.uint64]: ...

@final
class GraspIntent:
    def __new__(
        cls, rate_hz: float, maxima: NDArray[np.float64], tau: int, kind: str, preset: str
    ) -> GraspIntent: ...
    def process(self, samples: NDArray[np.float64]) -> NDArray[np.int64]: ...
    @property
    def channels(self) -> int: ...
    @property
    def levels(self) -> NDArray[np.int64]: ...
    @property
    def maxima(self) -> NDArray[np.float64]: ...
    @property
    def bad_channels(self) -> tuple[int, ...]: ...
    @property
    def held_samples(self) -> NDArray[np.uint64]: ...
    @property
    def holding(self) -> bool: ...

def grasp_level(value: float, maximum: float) -> int: ...
def fuse_levels(levels: Sequence[int]) -> int: ...
def channel_maxima(
    samples: NDArray[np.float64], rate_hz: float, tau: int, kind: str, percentile: float
) -> NDArray[np.float64]: ...

# --- hand ---

JOINT_NAMES: Final[list[str]]
JOINT_LIMITS_RAD: Final[list[tuple[float, float]]]
TORQUE_LIMITS: Final[NDArray[np.float64]]
CLOSURE_POSES_RAD: Final[NDArray[np.float64]]
DEFAULT_KP: Final[NDArray[np.float64]]
DEFAULT_KD: Final[NDArray[np.float64]]
DEFAULT_ERROR_LIMIT_RAD: Final[float]
DEFAULT_LEVEL_FACTORS: Final[NDArray[np.float64]]
DEFAULT_SLEW_PER_TICK: Final[float]
FULL_DUTY_SPEED_RAD_S: Final[float]
TIME_CONSTANT_S: Final[float]
TICK_S: Final[float]

@final
class HandController:
    def __new__(
        cls,
        *,
        poses_rad: NDArray[np.float64],
        kp: NDArray[np.float64],
        kd: NDArray[np.float64],
        error_limit_rad: float,
        torque_limits: NDArray[np.float64],
        level_factors: NDArray[np.float64],
        slew_per_tick: float,
    ) -> Self: ...
    def step(
        self,
        angles_rad: NDArray[np.float64],
        level: int,
        /,
        *,
        velocities_rad_s: NDArray[np.float64] | None,
        out: NDArray[np.float64] | None,
    ) -> NDArray[np.float64]: ...
    def reset(self, angles_rad: NDArray[np.float64], /) -> None: ...
    @property
    def target_rad(self) -> NDArray[np.float64] | None: ...
    @property
    def level(self) -> int | None: ...

@final
class JointModel:
    def __new__(
        cls,
        angles_rad: NDArray[np.float64],
        /,
        *,
        full_duty_speed_rad_s: float,
        time_constant_s: float,
    ) -> Self: ...
    def step(self, torques: NDArray[np.float64], /) -> NDArray[np.float64]: ...
    @property
    def angles_rad(self) -> NDArray[np.float64]: ...
    @property
    def velocities_rad_s(self) -> NDArray[np.float64]: ...

def step_modelled(
    controller: HandController, model: JointModel, level: int, /
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

# --- wire ---
