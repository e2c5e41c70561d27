"""Turn closure levels into joint targets and torques, for an Allegro Hand v4.

The hand sends its joint angles every 3 ms and takes torques only. :class:`HandController` is one call per
such cycle; :class:`JointModel` stands in for a hand that is not attached, and :class:`ModelledHand` is both
in one call.

Angles are in rad; torques in units of full motor duty (1.0 = 1200 counts; the hand measures no torque).
Joints are in the order of :data:`JOINT_NAMES`: index, middle, ring, thumb, four each from the palm outwards.
An array of another shape raises ``ShapeError``, one that is not numeric ``DtypeError``, a number that is not finite
or out of range ``InvalidValueError``, which names the joint.

Example:
    >>> from tega import hand
    >>> modelled = hand.ModelledHand()
    >>> for _ in range(700):
    ...     angles_rad, torques = modelled.step(3)
    >>> bool(abs(angles_rad - hand.CLOSURE_POSES_RAD[2]).max() < 0.005)
    True
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.wire.arrays import float_array


def _constant(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array


JOINT_NAMES: Final[tuple[str, ...]] = tuple(_native.JOINT_NAMES)
"""The 16 joints. Joint 0 of a finger is abduction, of the thumb opposition; 1 to 3 bend."""

JOINT_LIMITS_RAD: Final = _constant(np.array(_native.JOINT_LIMITS_RAD, np.float64))
"""Lowest and highest angle, float64 (16, 2); the stops are taken to lie 0.1 rad outside."""

TORQUE_LIMITS: Final = _constant(_native.TORQUE_LIMITS)
"""The vendor's torque limit of each joint, float64 (16,), torque units."""

CLOSURE_POSES_RAD: Final = _constant(_native.CLOSURE_POSES_RAD)
"""Joint angles of the closure levels 1 (open) to 5 (tight), float64 (5, 16); read-only."""

LEVEL_TORQUE_FACTORS: Final = _constant(_native.DEFAULT_LEVEL_FACTORS)
"""Share of the torque limit allowed in each level, float64 (5,)."""

MOST_ADDED_LEVELS: Final[float] = _native.MOST_ADDED_LEVELS
"""The most that a reflex may add to the level that a person asks for."""

TICK_S: Final[float] = _native.TICK_S
"""One control cycle, 3 ms: 333 1/3 a second."""


def closure_level(closure: float) -> float:
    """Return the place of a closure, 0 to 1, among the levels: ``1 + 4 · closure``, from 1 (open) to 5 (full).

    Example:
        >>> closure_level(0.6)
        3.4
    """
    return 1.0 + 4.0 * closure


def nearest_level(closure: float) -> int:
    """Return the closure level, 1 to 5, that is nearest to a closure, 0 to 1; the higher of two.

    Example:
        >>> nearest_level(0.6)
        3
    """
    return int(closure_level(closure) + 0.5)


def split_level(level: float) -> tuple[int, float | None]:
    """Return the nearest whole level (0: a hand that is let go), and the closure where the level lies between two.

    Example:
        >>> split_level(3), split_level(3.5)
        ((3, None), (4, 0.625))
    """
    whole = int(level + 0.5)
    return whole, None if whole == level else (level - 1.0) / 4.0


def joined_level(level: int, closure: float | None) -> float:
    """Return the level that :func:`split_level` was given."""
    return level if closure is None else closure_level(closure)


class HandController:
    """Steer a hand to the closure level asked for, within its torque, slew and speed limits.

    A change of level is a minimum-jerk move of 0.6 s from one level to its neighbour; the next step of a longer way
    starts after a third of it, so 1 to 5 takes 1.2 s. A new level may come at any time: position, velocity and
    acceleration of the target have no jump, its speed stays under 3 rad/s and it never leaves the joint limits. The
    first cycle (or :meth:`reset`) adopts the measured pose and leaves it slowly, in 1.5 to 4 s. A reflex's addition
    is superimposed on these moves, within the remaining part of the 3 rad/s: half a level within a tenth of a second.

    The torque is ``kp · (target - angle) - kd · velocity``, limited per joint, per level and in its change.
    Gravity is not compensated.

    Args:
        poses_rad: Closure poses, (5, 16), at least 0.04 rad inside the joint limits; None:
            :data:`CLOSURE_POSES_RAD`. Poses that lie far apart get longer moves.
        kp: Torque units per rad, one number or (16,); None: 1.5, thumb 2.0.
        kd: Torque units per rad/s, one number or (16,); None: 0.08.
        error_limit_rad: Position error above which the torque does not rise; None: 0.3.
        torque_limits: Torque units, one number or (16,), 0 to 1; None: :data:`TORQUE_LIMITS`.
        level_factors: Share of the torque limits in each level, (5,), 0 to 1; None:
            :data:`LEVEL_TORQUE_FACTORS`.
        slew_per_tick: Largest change of a torque in 3 ms; None: 0.05.
    """

    def __init__(
        self,
        *,
        poses_rad: ArrayLike | None = None,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        error_limit_rad: float | None = None,
        torque_limits: ArrayLike | None = None,
        level_factors: ArrayLike | None = None,
        slew_per_tick: float | None = None,
    ) -> None:
        default_error, default_slew = _native.DEFAULT_ERROR_LIMIT_RAD, _native.DEFAULT_SLEW_PER_TICK
        limits = TORQUE_LIMITS if torque_limits is None else torque_limits
        factors = LEVEL_TORQUE_FACTORS if level_factors is None else level_factors
        self._native = _native.HandController(
            poses_rad=float_array(
                "poses_rad", CLOSURE_POSES_RAD if poses_rad is None else poses_rad, (5, 16)
            ),
            kp=float_array("kp", _native.DEFAULT_KP if kp is None else kp, (16,), scalar=True),
            kd=float_array("kd", _native.DEFAULT_KD if kd is None else kd, (16,), scalar=True),
            error_limit_rad=default_error if error_limit_rad is None else error_limit_rad,
            torque_limits=float_array("torque_limits", limits, (16,), scalar=True),
            level_factors=float_array("level_factors", factors, (5,)),
            slew_per_tick=default_slew if slew_per_tick is None else slew_per_tick,
        )

    def step(
        self,
        angles_rad: ArrayLike,
        level: float,
        *,
        added: float = 0.0,
        velocities_rad_s: ArrayLike | None = None,
        out: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Run one cycle of 3 ms.

        Args:
            angles_rad: Measured joint angles, (16,).
            level: Closure level asked for, 1 to 5 with fractions between two poses.
            added: Levels that a reflex adds, 0 to :data:`MOST_ADDED_LEVELS`: that share of a step to the next level.
            velocities_rad_s: Measured joint velocities, (16,); None: estimated from the angles.
            out: Array for the torques, float64 (16,); may be the array of the angles.

        Returns:
            Torques, float64 (16,), in torque units; ``out`` where it is given.

        Raises:
            InvalidValueError: Level or addition is out of range, a number is not finite, or no encoder can report
                it. There is no torque then (``out`` holds zeros): send zero. The next torque starts from
                zero.
        """
        if out is not None:
            _check_out(out)
        try:
            if velocities_rad_s is not None:
                velocities_rad_s = float_array("velocities_rad_s", velocities_rad_s, (16,))
            angles_rad = float_array("angles_rad", angles_rad, (16,))
            return self._native.step(angles_rad, level, added, velocities_rad_s=velocities_rad_s, out=out)
        except BaseException:  # Ctrl-C and a panic of native code are no Exception
            if out is not None:
                out.fill(0.0)
            raise

    def step_encoded(
        self, angles_rad: NDArray[np.float64], level: float, *, added: float = 0.0, device_id: int = 0
    ) -> list[tuple[int, bytes, bool]]:
        """Run one cycle of 3 ms between both ends of a version 4 hand's cable, in one call.

        The same as :meth:`step` of the true angles as the hand's encoders show them, and
        :func:`tega.wire.allegro_torque_frames` of the torques: identifier and data of the four SET TORQUE frames,
        and that none is a request. ``WireError``: an angle is not finite or beyond what an encoder can report.
        """
        return self._native.step_encoded(angles_rad, level, added, device_id=device_id)

    def reset(self, angles_rad: ArrayLike) -> None:
        """Adopt a measured pose, (16,): the target is there and at rest, the torque starts from zero.

        An angle outside the joint limits is adopted at the limit.
        """
        self._native.reset(float_array("angles_rad", angles_rad, (16,)))

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last cycle, float64 (16,); None before a pose was adopted."""
        return self._native.target_rad

    @property
    def level(self) -> float | None:
        """The last requested level without the addition; None before the first cycle and after :meth:`reset`."""
        return self._native.level


class JointModel:
    """Sixteen ideal joints: each an inertia with viscous damping driven by motor duty, between two stops.

    ``time_constant_s · dv/dt = full_duty_speed_rad_s · torque - v``. No gravity, no friction at rest, no contact, no
    noise, no delay: its results are labelled modelled, and do not predict forces on an object.

    Args:
        angles_rad: Where the hand is at first, (16,); None: the open pose. A joint beyond a stop is put on
            it.
        full_duty_speed_rad_s: Speed at torque 1.0 without load; the default is the vendor's 60° in 0.11 s.
        time_constant_s: Time to 63 % of the speed. The default is a choice; no source gives it.
    """

    def __init__(
        self,
        angles_rad: ArrayLike | None = None,
        *,
        full_duty_speed_rad_s: float = _native.FULL_DUTY_SPEED_RAD_S,
        time_constant_s: float = _native.TIME_CONSTANT_S,
    ) -> None:
        start = CLOSURE_POSES_RAD[0] if angles_rad is None else float_array("angles_rad", angles_rad, (16,))
        self._native = _native.JointModel(
            start, full_duty_speed_rad_s=full_duty_speed_rad_s, time_constant_s=time_constant_s
        )

    def step(self, torques: ArrayLike) -> NDArray[np.float64]:
        """Apply torques, (16,), for one cycle of 3 ms and return the joint angles after it, float64 (16,), rad.

        Values beyond ±1 (full duty) count as ±1. Nothing moves where a torque is not finite.
        """
        return self._native.step(float_array("torques", torques, (16,)))

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Joint angles now, float64 (16,)."""
        return self._native.angles_rad

    @property
    def velocities_rad_s(self) -> NDArray[np.float64]:
        """Joint velocities now, float64 (16,)."""
        return self._native.velocities_rad_s


class ModelledHand:
    """A controller and a joint model closed into a loop; one native call a cycle.

    By default the controller has its defaults, and the model rests in the default open pose.
    """

    def __init__(self, controller: HandController | None = None, model: JointModel | None = None) -> None:
        self.controller = HandController() if controller is None else controller
        self.model = JointModel() if model is None else model

    def step(self, level: float, added: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Run one cycle of 3 ms: torques from the angles before it, and the angles they lead to.

        The same as ``torques = controller.step(model.angles_rad, level, added=added)`` and ``angles =
        model.step(torques)``; returns angles (rad) and torques, float64 (16,) each.
        """
        return _native.step_modelled(self.controller._native, self.model._native, level, added)  # noqa: SLF001


def _check_out(out: object) -> None:
    if not (isinstance(out, np.ndarray) and out.dtype == np.float64):
        kind = getattr(out, "dtype", type(out).__name__)
        raise DtypeError(f"out is {kind}, not an array of float64")
    if out.shape != (16,):
        raise ShapeError(f"out has shape {out.shape}, not (16,)")
    if not out.flags.writeable:
        raise InvalidValueError("out is a read-only array")
