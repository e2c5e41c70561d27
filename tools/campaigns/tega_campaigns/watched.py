"""A station that tells what it does, with the time: ``python -m tega_campaigns.watched robot.toml``.

One JSON object a line whenever hand, arm or vest do something else: ``t_s`` on this machine's monotonic clock,
``state`` of the run, ``arm``, ``felt`` (whether any motor of the vest turns) and ``no_data`` (whether it says that
none comes from the robot); ``said`` is what it tells a person. The robot's station tells besides how many commands it
has used (``used``), how many of them were really older than its time-to-live (``stale``), how old the oldest was since
it last told (``oldest_ms``), and how many of this operator's it has refused, by why (``refused``). For that it compares
the clocks of both stations directly, which are one clock where both run on one machine; the station itself goes by its
estimate.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tega.net.robot
from tega.config import load_config
from tega.errors import TegaError
from tega.net.commands import Commands
from tega.safety.ctrl_c import CtrlC
from tega.teleop import LoopView, run_session
from tega_emulators.hid_port import HidBoard, HidPort

if TYPE_CHECKING:
    from tega.net.messages import ArmMessage, HandMessage

__all__ = ["main"]

_COUNTS_S = 0.1


class _Judged(Commands):
    """Commands that are looked at, as they are used, by somebody who knows the true time."""

    newest: _Judged | None = None

    def __init__(self, *, ttl_ns: int, **rest: Any) -> None:
        self._looked = threading.local()
        super().__init__(ttl_ns=ttl_ns, clock=self._look, **rest)
        self._true_ttl_ns = ttl_ns
        self.used = self.stale = self.oldest_ns = 0
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

    def oldest(self) -> int:
        """Return how old the oldest was that was used since this was asked, ns."""
        oldest_ns, self.oldest_ns = self.oldest_ns, 0
        return oldest_ns

    def _look(self) -> int:
        """Return the time, and keep when it was: this program may be held up right after."""
        now_ns: int = time.monotonic_ns()
        self._looked.ns = now_ns
        return now_ns

    def _judge(self, command: HandMessage | ArmMessage | None) -> None:
        if command is not None:
            age_ns = self._looked.ns - command.sent_ns
            self.used += 1
            self.stale += age_ns > self._true_ttl_ns
            self.oldest_ns = max(self.oldest_ns, age_ns)


class _Teller:
    """Says what has changed."""

    def __init__(self) -> None:
        self._before: dict[str, Any] = {}
        self._counts_s = 0.0

    def __call__(self, view: LoopView) -> None:
        """See a moment."""
        arm = view.seen_arm
        seen: dict[str, Any] = {
            "state": view.state,
            "arm": "" if arm is None else f"{arm.state}: {arm.reason}",
            "felt": view.vest is not None and bool(view.vest.intensities.any()),
            "no_data": any("no data from the robot" in alert for alert in view.alerts),
        }
        now_s = time.monotonic()
        judged = _Judged.newest
        if seen == self._before and (judged is None or now_s < self._counts_s):
            return
        self._before, self._counts_s = seen, now_s + _COUNTS_S
        counts = (
            {}
            if judged is None
            else {
                "used": judged.used,
                "stale": judged.stale,
                "oldest_ms": judged.oldest() / 1e6,
                "refused": judged.refused,
            }
        )
        _say({"t_s": now_s, **seen, **counts})


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the station; return 3 with a sentence on the error output where it cannot."""
    parser = argparse.ArgumentParser(
        prog="python -m tega_campaigns.watched", description="A station that tells."
    )
    parser.add_argument("settings", type=Path)
    parser.add_argument("--cap", metavar="SOCKET", help="where an emulated SpaceMouse is")
    given = parser.parse_args()
    sys.setswitchinterval(0.0005)
    tega.net.robot.Commands = _Judged  # type: ignore[attr-defined]  # the same, with somebody who looks on
    with ExitStack() as stack:
        if given.cap is not None:
            stack.enter_context(HidPort(HidBoard(given.cap, 0x046D, 0xC626)).installed())
        stop = stack.enter_context(CtrlC())
        try:
            config = load_config(given.settings, environ={}).config
            _say({"t_s": time.monotonic(), "said": "begins"})
            run_session(
                config,
                observer=_Teller(),
                stop=stop,
                tell=lambda said: _say({"t_s": time.monotonic(), "said": said}),
            )
        except TegaError as error:
            _say({"t_s": time.monotonic(), "said": f"ended: {error}"})
            return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
