"""Define the table ``[ros2]``."""

from __future__ import annotations

from typing import Annotated

import msgspec

from tega.config.guests import TableContext
from tega_websocket.settings import check_claims

# A name of ROS 2: tokens of letters, digits and _, none beginning with a digit; "" for none.
_Topic = Annotated[str, msgspec.Meta(pattern=r"^((/[A-Za-z_][A-Za-z0-9_]*)+)?$", max_length=200)]


class Ros2Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Commands of a ROS 2 program; needs the extra ``ros2``.

    Attributes:
        hand: Topic of ``sensor_msgs/JointState`` that closes the hand, in place of ``[emg]``, such as
            ``/hand/target``; none by default.
        arm: Topic of ``geometry_msgs/PoseStamped`` with the forearm that leads the arm, in place of ``arm.tracker``,
            in the axes of ``arm.mapping.frame``; none by default.
        ttl_ms: Greatest age of a command that is obeyed.
    """

    hand: _Topic = ""
    arm: _Topic = ""
    ttl_ms: Annotated[float, msgspec.Meta(ge=20, le=2000)] = 200.0


def check_table(table: Ros2Table, context: TableContext) -> Ros2Table:
    """Check the table against the other settings."""
    check_claims("ros2", context.config, hand=bool(table.hand), arm=bool(table.arm))
    return table
