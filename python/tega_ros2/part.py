"""Join a run: a ROS 2 program closes the hand, or leads the arm, by checked messages, where the settings allow it."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from tega.errors import ConfigError
from tega.hand import JOINT_LIMITS_RAD, JOINT_NAMES
from tega.hand.poses import ClosureScale
from tega.loop.hand import hand_closure as closure_scale
from tega.loop.parts import PartContext, RunStart
from tega.records.display import Notice
from tega.runtime.threads import run_realtime
from tega_ros2.dds import DdsNode, Received, loopback_only
from tega_ros2.definitions import Definitions
from tega_ros2.settings import Ros2Table
from tega_websocket.commands import CommandedPart, Commands
from tega_websocket.messages import Arm, Hand, MessageError

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

_WAIT_S: Final = 0.05
_JOIN_S: Final = 5.0
_ALERT_NS: Final = 2_000_000_000
_KINDS: Final = {"hand": "sensor_msgs/msg/JointState", "arm": "geometry_msgs/msg/PoseStamped"}


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


class Ros2Part(CommandedPart):
    """Takes commands by DDS, in a thread of its own, and hands them to the loop.

    The program that commands first leads until it leaves. Its dead-man and clutch are the settings' own
    inputs.
    """

    def __init__(self, context: PartContext, table: Ros2Table) -> None:
        config, self._bus, self._topics = context.config, context.bus, {"hand": table.hand, "arm": table.arm}
        other = config.guests.get("websocket")
        for name, topic in self._topics.items():
            if topic and other is not None and getattr(other, name):
                raise ConfigError(
                    f"ros2.{name} and websocket.{name} both lead the {name}", "take out one of them"
                )
        frame = config.arm.mapping.frame if table.arm and config.arm is not None else None
        hand = bool(table.hand)
        super().__init__(
            Commands(ttl_ms=table.ttl_ms, hand=hand, arm=frame, name="ros2", peer="ROS 2 publisher")
        )
        self._scale = closure_scale(config) if table.hand else None
        self._definitions = Definitions("ros2")
        self._start_ns: int | None = None
        self._numbers: dict[str, int] = {}
        self._refused: Counter[str] = Counter()
        self._newest, self._broken = ("", 0), ""
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None

    def needs(self) -> Mapping[str, Callable[[], str]]:
        """Return the need of a client that leads the hand."""
        return {"ros2": self._commands.missing} if self._commands.hand else {}

    def open(self) -> None:
        """Subscribe, and print the topics."""
        node = DdsNode(self._definitions)
        readers = {name: node.reader(topic, _KINDS[name]) for name, topic in self._topics.items() if topic}
        where = f"domain {node.domain_id}" + (", this machine" if loopback_only() else "")
        topics = " and ".join(topic for topic in self._topics.values() if topic)
        self._bus.publish(Notice(text=f"ros2: {where}: waiting for {topics}"))
        work = run_realtime("beside")(lambda: self._work(node, readers))
        self._thread = threading.Thread(target=work, name="tega-ros2-commands", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._leaving.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(_JOIN_S)

    # The run's side.

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of a message that was refused just now, or of commands that cannot be received."""
        return {"ros2 commands": self._problem}

    def begin(self, run: RunStart) -> None:
        """Obey from now on."""
        super().begin(run)
        self._start_ns = run.start_ns

    def end(self) -> None:
        """Obey nothing any more."""
        self._start_ns = None
        super().end()

    def summary(self) -> dict[str, Any]:
        """Return the counts of publishers and commands."""
        counts = {"publishers": len(self._numbers), "commands": self._commands.n}
        return {"ros2": counts | {"refused": dict(self._refused)}}

    def _problem(self) -> str:
        if self._broken:
            return f"ros2: no command can be received any more: {self._broken}"
        text, at_ns = self._newest
        return f"ros2: {text}" if text and time.monotonic_ns() - at_ns < _ALERT_NS else ""

    # The thread's side.

    def _work(self, node: DdsNode, readers: Mapping[str, Any]) -> None:
        try:
            while not self._leaving.is_set():
                node.wait(_WAIT_S)
                for name, reader in readers.items():
                    for received in node.take(reader):
                        self._obey(name, received)
                there = set[str]().union(*map(node.senders, readers.values()))
                for sender in self._numbers.keys() - there:
                    self._commands.release(self._numbers[sender])
        except Exception as error:  # the run holds, and the page shows the operator why
            self._broken = f"{type(error).__name__}: {error}"
        finally:
            node.close()

    def _obey(self, name: str, received: Received) -> None:
        start_ns = self._start_ns
        if start_ns is None:
            return
        number = self._numbers.setdefault(received.sender, len(self._numbers) + 1)
        try:
            message = self._decoded(name, received.cdr)
            age = age_ns(message, sent_ns=received.sent_ns, now_ns=time.time_ns())
            t_ns = time.monotonic_ns() - start_ns - age
            if self._scale is not None and name == "hand":
                self._commands.obey(number, Hand(t_ns=t_ns, closure=hand_closure(message, self._scale)))
            else:
                position, quaternion = arm_pose(message)
                self._commands.obey(number, Arm(t_ns=t_ns, position_m=position, quaternion_xyzw=quaternion))
        except MessageError as error:
            self._refused[str(error).partition(":")[0]] += 1
            self._newest = f"{self._topics[name]} refused: {error}", time.monotonic_ns()

    def _decoded(self, name: str, cdr: bytes) -> Any:
        if len(cdr) > MOST_BYTES:
            raise MessageError(f"too long: {len(cdr)} bytes, {MOST_BYTES} are read")
        try:
            return self._definitions.store.deserialize_cdr(cdr, _KINDS[name])
        except Exception as error:  # whatever damage makes the library raise
            raise MessageError(f"damaged: {type(error).__name__}") from error


def open_part(context: PartContext) -> Ros2Part | None:
    """Subscribe to commands; ``None`` where the settings name no topic for them."""
    table = context.config.guests.get("ros2")
    if table is None or not (table.hand or table.arm):
        return None
    part = Ros2Part(context, table)
    context.stack.callback(part.close)
    part.open()
    return part
