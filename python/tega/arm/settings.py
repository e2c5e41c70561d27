"""Define the settings of the arm's chain, one struct a stage; every default has its source in ``docs/arm.md``."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec

from tega.errors import InvalidValueError

_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e4)]
_Gain = Annotated[float, msgspec.Meta(ge=0, le=2)]
_Ms = Annotated[float, msgspec.Meta(ge=1, le=60_000)]
_Triple = tuple[float, float, float]


class _ChainStage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    pass


class GateSettings(_ChainStage, frozen=True):
    """Limits within which a tracker's pose is accepted.

    Attributes:
        unit_error: Maximum deviation of a quaternion's length from one.
        age_ms: Maximum age of a pose.
        ahead_ms: Maximum time that a pose may lie in the future, since clocks differ.
        speed_m_s: Maximum speed between two poses.
        turn_rad_s: Maximum angular speed between two poses.
        step_m: Maximum distance from one used pose to the next.
        step_rad: Maximum rotation from one used pose to the next.
        room_m: Maximum magnitude of a coordinate.
    """

    unit_error: Annotated[float, msgspec.Meta(gt=0, le=0.1)] = 1e-3
    age_ms: _Ms = 100.0
    ahead_ms: _Ms = 20.0
    speed_m_s: _Positive = 3.0
    turn_rad_s: _Positive = 12.0
    step_m: _Positive = 0.10
    step_rad: Annotated[float, msgspec.Meta(gt=0, le=3)] = 0.6
    room_m: _Positive = 100.0


class MappingSettings(_ChainStage, frozen=True):
    """Axes, scale and gains by which motion of the forearm becomes motion of the target.

    Attributes:
        frame: Axes of the tracker, a name of :data:`tega.arm.FRAMES`.
        yaw_rad: Heading of the operator's "forward" in the tracker's axes turned into the base's, from calibration.
        base_yaw_rad: Direction of the base's x as the operator sees it, about the vertical: 0 away from the operator,
            π/2 to the left, π towards the operator; from calibration.
        scale: Scale of all displacement.
        gain_xyz: Gain of displacement along each of the base's axes; 0 locks it.
        gain_turn: Gain of rotation about each of the base's axes; 0 locks it.
        forearm: Side of the tracked forearm.
        robot_hand: Side of the hand on the robot.
        mirror: Whether motion is mirrored left to right; none means when those two differ.
        absolute: Whether a pose is where the arm's end is to go, in the base's axes, and not a forearm whose motion
            counts; for programs that compute such poses.
    """

    frame: Literal["base", "openxr", "unity", "ros"] = "openxr"
    yaw_rad: Annotated[float, msgspec.Meta(ge=-math.pi, le=math.pi)] = 0.0
    base_yaw_rad: Annotated[float, msgspec.Meta(ge=-math.pi, le=math.pi)] = 0.0
    scale: Annotated[float, msgspec.Meta(gt=0, le=1.5)] = 1.0
    gain_xyz: tuple[_Gain, _Gain, _Gain] = (1.0, 1.0, 1.0)
    gain_turn: tuple[_Gain, _Gain, _Gain] = (1.0, 1.0, 1.0)
    forearm: Literal["right", "left"] = "right"
    robot_hand: Literal["right", "left"] = "right"
    mirror: bool | None = None
    absolute: bool = False

    def __post_init__(self) -> None:
        """Check that no other setting changes absolute poses."""
        plain = self.frame in {"base", "ros"} and not (self.yaw_rad or self.base_yaw_rad or self.mirrored)
        if self.absolute and not (plain and {self.scale, *self.gain_xyz, *self.gain_turn} == {1.0}):
            raise InvalidValueError(
                "absolute poses are in the base's axes: frame, yaws, scale, gains or mirror would change them",
                "set frame = 'base' and leave out the others",
            )

    @property
    def mirrored(self) -> bool:
        """Whether motion is mirrored left to right."""
        return self.forearm != self.robot_hand if self.mirror is None else self.mirror


class FilterSettings(_ChainStage, frozen=True):
    """The One-Euro filter; its ``beta`` has units and is not the published one for pixels.

    Attributes:
        on: Whether it is used.
        cutoff_hz: Cutoff of position at rest.
        beta_per_m: Rise of that cutoff with speed, Hz per m/s.
        turn_cutoff_hz: Cutoff of rotation at rest.
        turn_beta_per_rad: Rise of that with turning, Hz per rad/s.
        speed_cutoff_hz: Cutoff of the speeds.
    """

    on: bool = True
    cutoff_hz: _Positive = 1.5
    beta_per_m: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 10.0
    turn_cutoff_hz: _Positive = 1.5
    turn_beta_per_rad: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 2.0
    speed_cutoff_hz: _Positive = 1.0


class LimitSettings(_ChainStage, frozen=True):
    """Workspace, speed and acceleration of the target, whatever the operator does.

    Attributes:
        low_m: Lower corner of the workspace, base's axes.
        high_m: Upper corner.
        tool_axis: The axis of the hand that tilts, in the hand's own axes; the flange's z points to the fingertips.
        upright: Where that axis points when there is no tilt, base's axes.
        tilt_rad: It may lean so far from there.
        speed_m_s: Maximum speed of the target.
        acceleration_m_s2: Maximum acceleration of the target.
        turn_rad_s: Maximum angular speed of the target.
        turn_acceleration_rad_s2: Maximum angular acceleration of the target.
        ahead_m: The target stays so close to the measured pose.
        ahead_rad: Largest angle between the target and the measured pose.
    """

    low_m: _Triple = (0.30, -0.40, 0.03)
    high_m: _Triple = (0.70, 0.40, 0.70)
    tool_axis: _Triple = (0.0, 0.0, 1.0)
    upright: _Triple = (1.0, 0.0, 0.0)
    tilt_rad: Annotated[float, msgspec.Meta(ge=0.05, le=1.5)] = 1.0
    speed_m_s: Annotated[float, msgspec.Meta(gt=0, le=1.7)] = 0.25
    acceleration_m_s2: Annotated[float, msgspec.Meta(gt=0, le=13)] = 2.0
    turn_rad_s: Annotated[float, msgspec.Meta(gt=0, le=2.5)] = 1.0
    turn_acceleration_rad_s2: Annotated[float, msgspec.Meta(gt=0, le=25)] = 6.0
    ahead_m: Annotated[float, msgspec.Meta(gt=0, le=10)] = 0.03
    ahead_rad: Annotated[float, msgspec.Meta(gt=0, le=3)] = 0.2

    def __post_init__(self) -> None:
        """Check that the box is finite and not empty, and that each axis has a direction."""
        for axis, low, high in zip("xyz", self.low_m, self.high_m, strict=True):
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise InvalidValueError(
                    f"the workspace's {axis} goes from {low} to {high} m: it has no inside"
                )
        for name in ("tool_axis", "upright"):
            size = math.hypot(*getattr(self, name))
            if not (math.isfinite(size) and size > 1e-6):
                raise InvalidValueError(f"{name} {getattr(self, name)} has no direction")


class WatchdogSettings(_ChainStage, frozen=True):
    """Times without news after which the target rests or the arm is let go.

    Attributes:
        hold_ms: Without a new pose, without a believable one, or without word from the arm: the target rests.
        lost_ms: Poses come but none is believed: the operator has to take hold again.
        silent_ms: Without any pose for this long, the operator has to take hold again.
        stop_ms: Still nothing: the arm is let go with damping.
        late_ms: The caller was away for longer than this: the target comes to rest meanwhile.
    """

    hold_ms: _Ms = 100.0
    lost_ms: _Ms = 250.0
    silent_ms: _Ms = 300.0
    stop_ms: _Ms = 1000.0
    late_ms: _Ms = 100.0

    def __post_init__(self) -> None:
        """Check that no later step comes before an earlier one."""
        if not (self.hold_ms <= self.lost_ms and self.hold_ms <= self.silent_ms <= self.stop_ms):
            raise InvalidValueError(
                f"hold_ms {self.hold_ms:g}, lost_ms {self.lost_ms:g}, silent_ms {self.silent_ms:g}, "
                f"stop_ms {self.stop_ms:g} are not in order",
                "hold_ms first, then lost_ms and silent_ms, stop_ms last",
            )


class ArmSettings(_ChainStage, frozen=True):
    """Settings of the arm's whole chain."""

    gate: GateSettings = GateSettings()
    mapping: MappingSettings = MappingSettings()
    filter: FilterSettings = FilterSettings()
    limits: LimitSettings = LimitSettings()
    watchdog: WatchdogSettings = WatchdogSettings()


def checked(settings: ArmSettings) -> ArmSettings:
    """Return the settings if every number is in its range; ``InvalidValueError`` names one that is not."""
    try:
        return msgspec.convert(msgspec.to_builtins(settings), ArmSettings)
    except msgspec.ValidationError as error:
        raise InvalidValueError(f"arm settings: {error}") from error
