"""Send the operator's closure level and forearm pose as commands to the robot's station."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from msgspec.structs import replace

from tega.arm.pose import PoseSource
from tega.config import SessionConfig
from tega.devices.registry import driver_class
from tega.devices.tracker.sources import RatePoses
from tega.errors import ConfigError
from tega.loop.inbox.inputs import Inputs, Seat
from tega.records import Intent, PoseNumbers
from tega.safety.guard import Guard
from tega_link.ends import FarHand
from tega_link.messages import ArmMessage, HandMessage, encode
from tega_link.settings import net_of

_KEPT = 1024


class ForearmReader:
    """Reads tracker and switches; the tracker is made at once, to know its axes, and opened later.

    ``frame`` is the axes of the poses; ``""`` where nothing leads an arm. Settings in which something leads
    an arm, and nothing would stop it at once, raise :class:`ConfigError`.
    """

    def __init__(self, config: SessionConfig) -> None:
        net = net_of(config)
        self._source: PoseSource | None = None
        self._seats: dict[str, Seat] = {}
        self._pose: PoseNumbers | None = None
        self.frame = ""
        if net is not None and net.tracker is not None:
            tracker: Any = driver_class(net.tracker.driver, "tracker")(net.tracker.options)
            self._source, self.frame = tracker, tracker.frame
        elif config.input.motion is not None:
            self.frame = RatePoses.frame
        if self.frame and config.input.dead_man is None:
            raise ConfigError(
                "something leads an arm here, but no dead-man switch is set to stop it at once",
                "set [input.dead_man], such as a pedal or a SpaceMouse's button",
            )

    def open(self, stack: ExitStack, inputs: Inputs) -> None:
        """Take note of the switches, and open the tracker; the stack closes it."""
        self._seats = dict(inputs.seats)
        source: Any = self._source
        if source is not None:
            stack.enter_context(source)
        elif (motion := self._seats.get("motion")) is not None:
            self._source = RatePoses(motion.source.state)

    def facts(self, *, may_move: bool) -> dict[str, Any]:
        """Return the fields of a command besides its stamp.

        Without ``may_move``, that this station's run is active, the dead-man does not count.
        """
        if self._source is not None:
            for pose in self._source.read(time.monotonic_ns()):
                x, y, z = map(float, pose.position_m)
                qx, qy, qz, qw = map(float, pose.quaternion_xyzw)
                self._pose = PoseNumbers(pose.t_ns, (x, y, z), (qx, qy, qz, qw), bool(pose.valid))
        dead_man = self._held("dead_man")
        return {
            "pose": self._pose,
            "dead_man": dead_man and may_move,
            "clutch": self._held("clutch") if "clutch" in self._seats else dead_man,
            # With the dead-man held it means nothing, as on one machine.
            "recover": self._held("recover") and not dead_man,
        }

    def _held(self, name: str) -> bool:
        if (seat := self._seats.get(name)) is None:
            return False
        held = seat.source.state().held
        return bool(held) if seat.button is None else seat.button in held


class IntentSender:
    """Puts the newest level, forearm and switches into commands.

    ``newest`` is the newest intent, its times by the monotonic clock. ``guard`` knows whether the run is active:
    without that the dead-man does not count. ``hand`` is the robot's as the loop sees it; ``None`` without. ``n``
    counts commands sent for it.
    """

    def __init__(
        self,
        forearm: ForearmReader,
        stamp: Callable[[str], dict[str, Any]],
        send_hand: Callable[[bytes], None],
        send_arm: Callable[[bytes], None],
    ) -> None:
        self._forearm, self._stamp = forearm, stamp
        self._send_hand, self._send_arm = send_hand, send_arm
        self._sent: deque[int] = deque(maxlen=_KEPT)
        self.newest = Intent(t_ns=0)
        self.guard: Guard | None = None
        self.hand: FarHand | None = None
        self.n = 0

    def lead_hand(self) -> None:
        """Send the hand's command."""
        requested = None if self.hand is None else self.hand.requested
        wanted = None
        if requested is not None:
            wanted = replace(self.newest, level=requested[0], closure=requested[1])
        stamp = self._stamp("hand")
        self._send_hand(encode(HandMessage(**stamp, intent=wanted)))
        self.n += 1
        if wanted is not None:
            self._sent.append(stamp["sent_ns"])

    def lead_arm(self) -> None:
        """Send the forearm's pose and the held switches."""
        may_move = self.guard is not None and self.guard.state == "active"
        self._send_arm(encode(ArmMessage(**self._stamp("arm"), **self._forearm.facts(may_move=may_move))))

    def let_go(self) -> None:
        """Send that nothing is wanted and nothing held any more."""
        if self.hand is not None:
            self.hand.limp()
        self.lead_hand()
        self._send_arm(encode(ArmMessage(**self._stamp("arm"))))

    def answered_ns(self, since_ns: int) -> tuple[int, int] | None:
        """Return a time, and when a command was first handed to the link at or after it: no report is waited for."""
        found = None
        for sent_ns in reversed(self._sent):
            if sent_ns < since_ns:
                break
            found = (since_ns, sent_ns)
        return found
