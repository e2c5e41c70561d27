"""Check messages of ROS 2 that command hand or arm."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from tega.hand import JOINT_LIMITS_RAD, JOINT_NAMES
from tega.hand.poses import ClosureScale
from tega_websocket.messages import MessageError

MOST_BYTES: Final = 65_536
"""Length of a command at most."""

CLOSURE: Final = "closure"
"""Name of the one joint of a ``JointState`` that gives a closure, 0 (open) to 1 (closed)."""

# Beyond these a value is a mistake, such as degrees or percent, and not a target a little outside the limits.
_MOST_RAD: Final = math.pi
_CLOSURE_OVER: Final = 0.1
_MOST_M: Final = 100.0
# A publisher's clock may be so far ahead of ours.
_AHEAD_NS: Final = 20_000_000


def hand_closure(message: Any, scale: ClosureScale) -> float:
    """Return the closure that a ``JointState`` asks for, 0 to 1.

    It names either ``closure`` alone or all joints of the hand, in any order, rad. Joint angles are clipped
    to the hand's limits, and the closure is that of the nearest pose between open and closed. Names or
    lengths that do not fit, or a value not finite or far outside, raise :class:`MessageError`.
    """
    names, position = list(message.name), np.asarray(message.position, np.float64)
    if len(position) != len(names):
        raise MessageError(f"wrong length: {len(names)} names and {len(position)} positions")
    for field in ("velocity", "effort"):
        if len(getattr(message, field)) not in {0, len(names)}:
            raise MessageError(
                f"wrong length: {len(names)} names and {len(getattr(message, field))} of {field}"
            )
    if not np.isfinite(position).all():
        raise MessageError("not finite: a position is NaN or infinite")
    if names == [CLOSURE]:
        closure = float(position[0])
        if not -_CLOSURE_OVER <= closure <= 1.0 + _CLOSURE_OVER:
            raise MessageError(f"out of range: closure {closure:.6g}; it is 0 (open) to 1 (closed)")
        return min(max(closure, 0.0), 1.0)
    if sorted(names) != sorted(JOINT_NAMES):
        raise MessageError(
            f"wrong joints: {len(names)} names; give {CLOSURE!r}, or all {len(JOINT_NAMES)} of /hand/joints"
        )
    at = dict(zip(names, position, strict=True))
    angles_rad = np.array([at[name] for name in JOINT_NAMES])
    worst = int(np.argmax(np.abs(angles_rad)))
    if abs(angles_rad[worst]) > _MOST_RAD:
        raise MessageError(f"out of range: {JOINT_NAMES[worst]} at {angles_rad[worst]:.6g} rad")
    return (scale(np.clip(angles_rad, JOINT_LIMITS_RAD[:, 0], JOINT_LIMITS_RAD[:, 1])) - 1.0) / 4.0


def arm_pose(message: Any) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return position, m, and orientation, a unit quaternion x, y, z, w, of a ``PoseStamped``.

    A value not finite or far outside, or another length, raises :class:`MessageError`.
    """
    place, turn = message.pose.position, message.pose.orientation
    position, quaternion = (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, (*position, *quaternion))):
        raise MessageError("not finite: a number of the pose is NaN or infinite")
    if max(map(abs, position)) > _MOST_M:
        raise MessageError(f"out of range: position {position} m")
    if abs(math.hypot(*quaternion) - 1.0) > 1e-3:
        raise MessageError("out of range: the orientation has not unit length")
    return position, quaternion


def age_ns(message: Any, *, sent_ns: int, now_ns: int) -> int:
    """Return the age of a message by its header, or by when it was published where the header has no time.

    Both times are since 1970: ``sent_ns`` by the publisher's clock, ``now_ns`` the time of day here. One
    ahead of this machine's raises :class:`MessageError`.
    """
    stamp = message.header.stamp
    stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
    age = now_ns - (stamp_ns or sent_ns)
    if age < -_AHEAD_NS:
        raise MessageError(
            f"ahead: its time is {-age / 1e9:.3g} s ahead of this machine's; synchronise the clocks"
        )
    return max(age, 0)
