"""Judges how old the commands of the other station really are when the robot's station uses them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import tega_link.robot
from tega_link.commands import Commands
from tega_link.messages import ArmMessage, HandMessage

__all__ = ["JudgedCommands", "measure_beside_on"]


class JudgedCommands(Commands):
    """Commands that are looked at, as they are used, by somebody who knows the true time."""

    newest: JudgedCommands | None = None

    def __init__(self, *, ttl_ns: int, **rest: Any) -> None:
        self._looked = threading.local()
        super().__init__(ttl_ns=ttl_ns, clock=self._check, **rest)
        self._true_ttl_ns = ttl_ns
        self._used = self._stale = self._oldest_ns = 0
        type(self).newest = self

    def hand(self, data: bytes) -> HandMessage | None:
        """Take in a command for the hand, and judge it."""
        command = super().hand(data)
        self._judge(command)
        return command

    def arm(self, data: bytes) -> ArmMessage | None:
        """Take in a command for the arm, and judge it."""
        command = super().arm(data)
        self._judge(command)
        return command

    def counts(self) -> dict[str, Any]:
        """Return what was used and refused so far, and how old the oldest was since this was asked."""
        oldest_ns, self._oldest_ns = self._oldest_ns, 0
        return {
            "used": self._used,
            "stale": self._stale,
            "oldest_ms": oldest_ns / 1e6,
            "refused": self.refused,
        }

    def _check(self) -> int:
        """Return the time, and keep when it was: this program may be held up right after."""
        now_ns: int = time.monotonic_ns()
        self._looked.ns = now_ns
        return now_ns

    def _judge(self, command: HandMessage | ArmMessage | None) -> None:
        if command is not None:
            age_ns = self._looked.ns - command.sent_ns
            self._used += 1
            self._stale += age_ns > self._true_ttl_ns
            self._oldest_ns = max(self._oldest_ns, age_ns)


def measure_beside_on() -> Callable[[], dict[str, Any]]:
    """Have this program's robot station judged; return the getter of its counts, ``{}`` before it begins."""
    # The same, with somebody who looks on.
    tega_link.robot.Commands = JudgedCommands  # type: ignore[attr-defined]

    def counts() -> dict[str, Any]:
        judged = JudgedCommands.newest
        return {} if judged is None else judged.counts()

    return counts
