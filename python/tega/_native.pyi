"""Typed face of the extension module; proved by `python -m mypy.stubtest tega._native`."""

import sys
from collections.abc import Sequence
from typing import Any, Final, Literal, Self, final

import numpy as np
from numpy.typing import NDArray

__version__: Final[str]

_Bytes = NDArray[np.uint8]
_Floats = NDArray[np.float64]
_CanFrame = tuple[int, bytes, bool]
"""Identifier, data, and whether it is a request."""

# --- tactile ---

_Contact = tuple[float, tuple[float, float], float, float, int, float, float, tuple[int, int], bool]

@final
class Equations:
    def __new__(
        cls,
        *,
        weights: tuple[float, float, float],
        order: str,
        difference: str,
        spread: str,
        factor: float,
        centroid_value: str,
        gate: tuple[float, int] | None,
    ) -> Self: ...
    def metrics(self, frame: _Bytes, baseline: _Bytes, /) -> _Contact: ...
    def metrics_many(self, frames: Sequence[_Bytes], baselines: Sequence[_Bytes], /) -> list[_Contact]: ...

@final
class Preset:
    def __new__(cls, *, reading: str, order: str, outline: str, noise: Sequence[float] | None) -> Self: ...
    def read(self, frame: _Bytes, baseline: _Bytes, /) -> _Contact: ...
    def read_many(self, frames: Sequence[_Bytes], baselines: Sequence[_Bytes], /) -> list[_Contact]: ...
    def mask(self, frame: _Bytes, baseline: _Bytes, /) -> NDArray[np.bool_]: ...
    def pressure_map(self, frame: _Bytes, baseline: _Bytes, /) -> NDArray[np.float32]: ...
    def known(self, baseline: _Bytes, /) -> KnownBaseline: ...

@final
class KnownBaseline:
    def read(self, frame: _Bytes, /) -> _Contact: ...

def estimate_baseline(frames: Sequence[_Bytes]) -> tuple[_Bytes, list[int]]: ...

@final
class TrackedContact:
    in_contact: Final[bool]
    eda: Final[int]
    area_mm2: Final[float | None]
    cci: Final[float]
    peak: Final[float]
    depth_mm: Final[float]
    force_n: Final[float]
    mass: Final[float]
    centroid_xy: Final[tuple[float, float]]
    centroid_mm: Final[tuple[float, float] | None]
    spread: Final[float]
    spread_mm: Final[float | None]
    strength: Final[float]
    broad: Final[float]
    difference: Final[float]
    threshold: Final[float]
    def __new__(cls, *fields: Any) -> Self: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class TouchTracker:
    def __new__(
        cls,
        baseline: _Bytes,
        /,
        *,
        rate_hz: float,
        noise: Sequence[float] | None,
        light: tuple[Sequence[Sequence[Sequence[float]]], float, float] | None,
        order: str,
        outline: str,
        rezero: bool,
    ) -> Self: ...
    bears_load: Final[bool]
    banding: Final[float]
    def rezero(self) -> bool: ...
    def update(self, frame: _Bytes, /, *, dt_s: float | None, loaded: bool) -> TrackedContact: ...
    def update_sums(
        self, sums: NDArray[np.int16], /, *, dt_s: float | None, loaded: bool
    ) -> TrackedContact: ...
    def mask(self) -> NDArray[np.bool_]: ...
    def depth_map(self) -> NDArray[np.float32]: ...

def update_fingers(
    trackers: Sequence[TouchTracker], frames: Sequence[_Bytes], *, dt_s: float | None
) -> list[TrackedContact]: ...
def nominal_light() -> tuple[list[list[list[float]]], float, float]: ...
def sensor_noise(frames: Sequence[_Bytes], *, order: str) -> list[float]: ...
def instruction_set() -> Literal["baseline", "neon", "avx2"]: ...
def vote_lines(image: _Bytes, /) -> tuple[float, list[bytes]]: ...
def picture_bands(image: _Bytes, /) -> bytes: ...
def band_distances(one: bytes, other: bytes, /) -> list[float]: ...

# --- haptics ---

_Columns = tuple[float, float, float, float]

FINGERS: Final[list[str]]
HIGH_SHARE: Final[float]

def logistic_intensity(value: float, maximum: float, /, *, end_value: float) -> float: ...
def linear_intensity(value: float, maximum: float, /) -> float: ...
def contact_type(cci_norm: float, eda_norm: float, /) -> str: ...
def vest_intensities(front: _Columns, back: _Columns, /, *, layout: str, mirror: str) -> _Bytes: ...
def vest_percents(levels: _Floats, /) -> _Bytes: ...
def layout_motors(layout: str, /) -> _Bytes: ...
def vest_x40(layout: str, intensities: _Bytes, /) -> _Bytes: ...

# --- emg ---

@final
class ButterworthLowpass:
    def __new__(cls, rate_hz: float, cutoff_hz: float, order: int, channels: int) -> ButterworthLowpass: ...
    def process(self, samples: _Floats) -> _Floats: ...
    channels: Final[int]
    sos: Final[_Floats]
    held_samples: Final[NDArray[np.uint64]]

@final
class BlockMean:
    def __new__(cls, tau: int, channels: int | None) -> BlockMean: ...
    def process(self, samples: _Floats) -> _Floats: ...
    channels: Final[int | None]
    held_samples: Final[NDArray[np.uint64]]

@final
class GraspIntent:
    def __new__(
        cls,
        rate_hz: float,
        maxima: _Floats,
        tau: int,
        kind: str,
        preset: str,
        *,
        cutoff_hz: float,
        order: int,
        intervals: int,
        fusion: str,
        weights: Sequence[float] | None,
    ) -> GraspIntent: ...
    def process(self, samples: _Floats) -> NDArray[np.int64]: ...
    channels: Final[int]
    levels: Final[NDArray[np.int64]]
    maxima: Final[_Floats]
    bad_channels: Final[tuple[int, ...]]
    held_samples: Final[NDArray[np.uint64]]
    holding: Final[bool]

@final
class ChannelVotes:
    def __new__(
        cls,
        rate_hz: float,
        *,
        hop: int,
        stuck: int,
        stuck_from: Sequence[float],
        still: int,
        mains: int,
        mains_share: float,
        mains_rms: Sequence[float],
        lines_hz: Sequence[float],
        back: int,
    ) -> ChannelVotes: ...
    def take(self, samples: _Floats) -> tuple[bool, _Floats | None]: ...
    faults: Final[list[tuple[Literal["stuck", "mains"], float] | None]]
    began: Final[int | None]
    still: Final[bool]
    room: Final[int]

def grasp_level(value: float, maximum: float) -> int: ...
def fuse_levels(levels: Sequence[int]) -> int: ...
def channel_maxima(samples: _Floats, rate_hz: float, tau: int, kind: str, percentile: float) -> _Floats: ...

# --- gel ---

_Point = tuple[float, float, float]
_Pose = tuple[_Floats, _Floats]
_Indenter = tuple[str, _Point, _Floats, float]
_Touch = tuple[bool, int, float, float, tuple[float, float]]

GEL_PX_PER_MM: Final[float]
GEL_LENGTH_MM: Final[float]
GEL_STIFFNESS_N_MM3: Final[float]
GEL_RADIUS_ACROSS_MM: Final[float]
GEL_HEIGHTS_ALONG_MM: Final[list[tuple[float, float]]]
GEL_MIDDLE_ALONG_MM: Final[float]
GEL_CAMERA_MM: Final[float]

def gel_fall(x_mm: float, y_mm: float, /) -> tuple[float, float]: ...
def gel_pad_pose(
    pad: _Pose, near_m: _Point, normal: _Point, shape: _Pose, /, *, radius_m: float, half_length_m: float
) -> _Floats: ...

@final
class Gel:
    def __new__(cls, seed: int, /, *, spread: float, shape: str, memory: bool) -> Self: ...
    def press(self, indenters: Sequence[_Indenter], t_s: float, /) -> bool: ...
    def touch(self) -> _Touch: ...
    def in_view(self) -> float: ...
    def frame(self, indenters: Sequence[_Indenter], index: int, /, *, t_s: float, out: _Bytes) -> None: ...
    def sums(self, indenters: Sequence[_Indenter], index: int, /, *, t_s: float) -> NDArray[np.int16]: ...
    def remains(self, t_s: float) -> bool: ...
    def last_s(self) -> float | None: ...
    def forget(self) -> None: ...
    def still(self, index: int, /) -> _Bytes: ...
    def contact_mask(self) -> NDArray[np.bool_]: ...
    def displacement_mm(self) -> NDArray[np.float32]: ...
    def surface(self) -> NDArray[np.float32]: ...

# --- sim ---

def limit_torques(torques: _Floats, limits: _Floats, out: _Floats, /) -> bool: ...
def mix_muscles(
    sensor: _Floats,
    sources: tuple[_Floats, _Floats, _Floats],
    scales: tuple[float, ...],
    first: int,
    end: int,
    /,
) -> _Floats: ...

# --- hand ---

JOINT_NAMES: Final[list[str]]
JOINT_LIMITS_RAD: Final[list[tuple[float, float]]]
TORQUE_LIMITS: Final[_Floats]
CLOSURE_POSES_RAD: Final[_Floats]
DEFAULT_KP: Final[_Floats]
DEFAULT_KD: Final[_Floats]
DEFAULT_ERROR_LIMIT_RAD: Final[float]
DEFAULT_LEVEL_FACTORS: Final[_Floats]
DEFAULT_SLEW_PER_TICK: Final[float]
FULL_DUTY_SPEED_RAD_S: Final[float]
TIME_CONSTANT_S: Final[float]
MOST_ADDED_LEVELS: Final[float]
TICK_S: Final[float]
WARM_C: Final[float]
TOO_HOT_C: Final[int]

@final
class HandController:
    def __new__(
        cls,
        *,
        poses_rad: _Floats,
        kp: _Floats,
        kd: _Floats,
        error_limit_rad: float,
        torque_limits: _Floats,
        level_factors: _Floats,
        slew_per_tick: float,
    ) -> Self: ...
    def step(
        self,
        angles_rad: _Floats,
        level: float,
        added: float,
        /,
        *,
        velocities_rad_s: _Floats | None,
        out: _Floats | None,
    ) -> _Floats: ...
    def step_encoded(
        self, angles_rad: _Floats, level: float, added: float, /, *, device_id: int
    ) -> list[_CanFrame]: ...
    def reset(self, angles_rad: _Floats, /) -> None: ...
    target_rad: Final[_Floats | None]
    level: Final[float | None]

@final
class JointModel:
    def __new__(
        cls, angles_rad: _Floats, /, *, full_duty_speed_rad_s: float, time_constant_s: float
    ) -> Self: ...
    def step(self, torques: _Floats, /) -> _Floats: ...
    angles_rad: Final[_Floats]
    velocities_rad_s: Final[_Floats]

@final
class HandLink:
    def __new__(
        cls,
        controller: HandController,
        /,
        *,
        device_id: int,
        left: bool,
        torque: bool,
        silent_after_ns: int,
        lowest_rate_hz: float,
        reconnects: int,
    ) -> Self: ...
    def exchange(
        self,
        frames: list[tuple[int, bytes | bytearray, bool, bool, bool]],
        t_ns: int,
        level: float,
        added: float,
        /,
    ) -> list[_CanFrame]: ...
    def release(self, t_ns: int, /) -> None: ...
    def abandon(self) -> list[_CanFrame]: ...
    def heat_share(self, t_ns: int, /) -> float: ...
    phase: Final[str]
    released: Final[bool]
    fault: Final[tuple[str, str, str] | None]
    angles_rad: Final[_Floats | None]
    target_rad: Final[_Floats | None]
    torques: Final[_Floats]
    info: Final[tuple[int, int, int, int, int] | None]
    serial: Final[str]
    joints_c: Final[list[int | None]]
    counts: Final[dict[str, int]]

def bare_clock(period_ns: int, n_ticks: int, /) -> list[int]: ...
def step_modelled(
    controller: HandController, model: JointModel, level: float, added: float, /
) -> tuple[_Floats, _Floats]: ...

# --- serial ---

if sys.platform != "win32":
    @final
    class SerialDrain:
        def __new__(cls, fd: int, /) -> Self: ...
        def take(self) -> tuple[bytes, int]: ...
        def close(self) -> None: ...

# --- wire ---

ALLEGRO_RAD_PER_COUNT: Final[float]
ALLEGRO_PWM_LIMITS: Final[tuple[int, ...]]

def allegro_torque_frames(
    torques: _Floats, /, *, device_id: int, version: int
) -> list[tuple[int, bytes]]: ...
def allegro_angles_rad(counts: NDArray[np.int16], /, *, version: int) -> _Floats: ...
def allegro_angle_counts(angles_rad: _Floats, /, *, version: int) -> NDArray[np.int16]: ...
def allegro_decode(
    can_id: int, data: bytes, /, *, device_id: int, remote: bool, extended: bool, error: bool
) -> tuple[str, int, list[int]]: ...
def allegro_requested(
    can_id: int, /, *, device_id: int
) -> tuple[Literal["info", "serial", "imu", "position", "temperature"], int | None] | None: ...
def allegro_encode(kind: str, finger: int, values: list[int], /, *, device_id: int) -> _CanFrame: ...
def motor_steps(intensities: _Bytes, /) -> _Bytes: ...
def x40_ble_frame(intensities: _Bytes, /, *, front_mirror: bool) -> bytes: ...
def x40_ble_steps(frame: bytes, /, *, front_mirror: bool) -> _Bytes: ...
def x16_steps(frame: bytes, /, *, front_mirror: bool) -> _Bytes: ...
def hid_motor_report(
    intensities: _Bytes, /, *, sequence: int, ttl_ms: int, request_status: bool
) -> bytes: ...
def hid_stop_report(*, sequence: int) -> bytes: ...
def hid_motor(report: bytes, /) -> tuple[int, tuple[_Bytes, int, bool] | None]: ...
def hid_status(report: bytes, /) -> tuple[int, int, int | None, int, int, int]: ...
def hid_status_report(status: tuple[int, int, int | None, int, int, int], /) -> bytes: ...

_CytonRows = tuple[_Bytes, _Bytes, NDArray[np.int32], _Floats, _Floats, NDArray[np.int64], _Bytes, _Bytes]

@final
class CytonStream:
    def __new__(cls, *, gain: int) -> CytonStream: ...
    def feed(self, data: bytes, /) -> _CytonRows: ...
    def stats(self) -> tuple[int, int, int, int]: ...

@final
class ChordsStream:
    def __new__(cls, *, channels: int) -> ChordsStream: ...
    def feed(self, data: bytes, /) -> tuple[_Bytes, _Bytes, NDArray[np.uint16]]: ...
    def stats(self) -> tuple[int, int, int, int]: ...

def chords_channels(data: bytes, /) -> int | None: ...

@final
class SpikerStream:
    def __new__(cls, *, channels: int) -> SpikerStream: ...
    def feed(self, data: bytes, /) -> NDArray[np.uint16]: ...
    def stats(self) -> tuple[int, int, int, int]: ...

@final
class AsciiStream:
    def __new__(cls, *, channels: int, leading: int, drop_first: bool) -> AsciiStream: ...
    def feed(self, data: bytes, /) -> _Floats: ...
    def stats(self) -> tuple[int, int, int, int]: ...
    def last_rejected(self) -> bytes: ...
