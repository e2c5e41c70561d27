"""Send the operator's closure level and forearm pose as commands to the robot's station."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from tega.records import Intent
from tega_link.ends import FarHand
from tega_link.messages import ArmMessage, HandMessage, encode

if TYPE_CHECKING:
    from tega.safety.guard import Guard
    from tega_link.forearm import ForearmReader


_KEPT = 1024


class IntentSender:
    """Puts the newest level, forearm and switches into commands.

    Args:
        forearm: Tracker and switches.
        stamp: Returns what every message of a stream begins with.

    Attributes:
        hand: The robot's hand as the loop sees it; ``None`` where there is none.
        n: Commands for the hand that were sent.
    """

    def __init__(self, forearm: ForearmReader, stamp: Callable[[str], dict[str, Any]]) -> None:
        self._forearm, self._stamp = forearm, stamp
        self._send_hand: Callable[[bytes], None] = lambda _message: None
        self._send_arm: Callable[[bytes], None] = lambda _message: None
        self._sent: deque[int] = deque(maxlen=_KEPT)
        self._newest = Intent(t_ns=0)
        self._guard: Guard | None = None
        self.hand: FarHand | None = None
        self.n = 0

    def open(self, send_hand: Callable[[bytes], None], send_arm: Callable[[bytes], None]) -> None:
        """Take note of what sends commands."""
        self._send_hand, self._send_arm = send_hand, send_arm

    def give_hand(self, robot: str) -> FarHand:
        """Return the hand that the loop steers in the place of a robot's."""
        self.hand = FarHand(robot, answered=self._answered_ns)
        return self.hand

    def begin(self, guard: Guard) -> None:
        """Take note of what knows whether the run is active: without that the dead-man does not count."""
        self._guard = guard

    def intent(self, intent: Intent) -> None:
        """Note the newest intent, its times by the monotonic clock."""
        self._newest = intent

    def lead_hand(self) -> None:
        """Send the hand's command."""
        requested = None if self.hand is None else self.hand.requested
        wanted = None
        if requested is not None:
            wanted = replace(self._newest, level=requested[0], closure=requested[1])
        stamp = self._stamp("hand")
        self._send_hand(encode(HandMessage(**stamp, intent=wanted)))
        self.n += 1
        if wanted is not None:
            self._sent.append(stamp["sent_ns"])

    def lead_arm(self) -> None:
        """Send the forearm's pose and the held switches."""
        may_move = self._guard is not None and self._guard.state == "active"
        self._send_arm(encode(ArmMessage(**self._stamp("arm"), **self._forearm.facts(may_move=may_move))))

    def let_go(self) -> None:
        """Send that nothing is wanted and nothing held any more."""
        if self.hand is not None:
            self.hand.limp()
        self.lead_hand()
        self._send_arm(encode(ArmMessage(**self._stamp("arm"))))

    def _answered_ns(self, since_ns: int) -> tuple[int, int] | None:
        """Return a time, and when a command was first handed to the link at or after it: no report is waited for."""
        found = None
        for sent_ns in reversed(self._sent):
            if sent_ns < since_ns:
                break
            found = (since_ns, sent_ns)
        return found
