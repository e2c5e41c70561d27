"""Run a session from its settings, as ``tega-teleop run`` does, and say how it is: the program a campaign watches.

``python -m tega_campaigns.program SETTINGS.toml`` writes a line of JSON whenever state, alerts, arm or touch change and
twice a second, and at last one with ``ended``. ``at_s`` is this machine's monotonic clock; ``said`` is what the program
tells a person. A line ``clock 3600`` on its standard input sets its time of day forward, as somebody who sets the
computer's clock would; the end of its input ends the run.

``--commands`` has the robot's station tell besides, ten times a second, how many commands it has used (``used``), how
many of them were really older than their time-to-live (``stale``), how old the oldest was since it last told
(``oldest_ms``), and how many it has refused, by why (``refused``). For that it compares the clocks of both stations
directly, which are one clock where both run on one machine; the station itself goes by its estimate.
"""

from __future__ import annotations

import argparse
import json
import mmap
import os
import re
import struct
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import tega.net.robot
from tega.config import load_config
from tega.errors import TegaError
from tega.net.commands import Commands
from tega.net.messages import ArmMessage, HandMessage
from tega.safety.ctrl_c import CtrlC
from tega.safety.states import Transition
from tega.teleop import run_session
from tega.teleop.moment import LoopView
from tega_emulators.hid_port import HidBoard, HidPort

__all__ = ["REFUSED", "main", "noted_tick_ns"]

REFUSED = 3
"""Exit code of a run that a :class:`~tega.errors.TegaError` has ended."""

_EVERY_S, _COUNTS_S = 0.5, 0.1
_NOTE_BYTES = 8
_PAGE_MIB = os.sysconf("SC_PAGE_SIZE") / 2**20 if hasattr(os, "sysconf") else 0.0
_MEMORY = Path("/proc/self/statm")


class _Judged(Commands):
    """Commands that are looked at, as they are used, by somebody who knows the true time."""

    newest: _Judged | None = None

    def __init__(self, *, ttl_ns: int, **rest: Any) -> None:
        self._looked = threading.local()
        super().__init__(ttl_ns=ttl_ns, clock=self._look, **rest)
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

    def _look(self) -> int:
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


class _Teller:
    """Says what has changed, and notes how far the loop has come.

    Args:
        progress: Memory of a file that a kill leaves; ``None`` for no note.
    """

    def __init__(self, progress: mmap.mmap | None) -> None:
        self._key = ""
        self._next_s = 0.0
        self._progress = progress

    def look(self, view: LoopView) -> None:
        """See a moment."""
        if self._progress is not None:
            struct.pack_into("<q", self._progress, 0, view.t_ns)
        now_s = time.monotonic()
        arm = "" if view.seen_arm is None else f"{view.seen_arm.state}: {view.seen_arm.reason}"
        felt = view.vest is not None and bool(view.vest.intensities.any())
        # Numbers that count up, such as for how long a picture is missing, are no news.
        key = re.sub(r"[\d.]+", "#", f"{view.state} {view.reason} {view.alerts} {arm} {felt}")
        if key == self._key and now_s < self._next_s:
            return
        judged = _Judged.newest
        self._key, self._next_s = key, now_s + (_EVERY_S if judged is None else _COUNTS_S)
        _say(
            state=view.state,
            reason=view.reason,
            alerts=list(view.alerts),
            arm=arm,
            felt=felt,
            no_data=any("no data from the robot" in alert for alert in view.alerts),
            rss_mib=_rss_mib(),
            **({} if judged is None else judged.counts()),
        )


def noted_tick_ns(path: Path) -> int:
    """Return how far a run had come as it noted itself in a file; -1 where it had not begun."""
    data = path.read_bytes() if path.exists() else b""
    return int(struct.unpack("<q", data)[0]) if len(data) == _NOTE_BYTES else -1


def _say(**what: Any) -> None:
    """Write a line."""
    sys.stdout.write(json.dumps({"at_s": time.monotonic(), **what}) + "\n")
    sys.stdout.flush()


def _change(change: Transition) -> None:
    _say(state=change.state, reason=change.reason)


def _rss_mib() -> float:
    """Return the resident memory; 0 where the system does not tell."""
    return int(_MEMORY.read_text("ascii").split()[1]) * _PAGE_MIB if _MEMORY.exists() else 0.0


def _listen(stop: CtrlC) -> None:
    true_ns, offset_ns = time.time_ns, 0
    for line in sys.stdin:
        verb, _, seconds = line.strip().partition(" ")
        if verb == "clock":
            # Nobody but the machine's owner may set its clock; this process is shown another one.
            offset_ns += round(float(seconds) * 1e9)
            time.time_ns = lambda: true_ns() + offset_ns  # noqa: B023
            time.time = lambda: (true_ns() + offset_ns) / 1e9  # noqa: B023
    stop.ask("the campaign is over")


def main() -> int:
    """Run until the standard input ends; return 3 where a :class:`~tega.errors.TegaError` ends it."""
    parser = argparse.ArgumentParser(
        prog="python -m tega_campaigns.program", description="A run that says how it is."
    )
    parser.add_argument("settings", type=Path)
    parser.add_argument("--cap", metavar="SOCKET", help="where an emulated SpaceMouse is")
    parser.add_argument("--commands", action="store_true", help="judge the age of every command that is used")
    parser.add_argument("--progress", type=Path, metavar="FILE", help="note there how far the loop has come")
    given = parser.parse_args()
    sys.setswitchinterval(0.0005)  # as in ``run``
    if given.commands:
        # The same, with somebody who looks on.
        tega.net.robot.Commands = _Judged  # type: ignore[attr-defined]
    with ExitStack() as stack:
        if given.cap is not None:
            stack.enter_context(HidPort(HidBoard(given.cap, 0x046D, 0xC626)).installed())
        progress = None
        if given.progress is not None:
            given.progress.write_bytes(struct.pack("<q", -1))
            file = stack.enter_context(given.progress.open("r+b"))
            progress = stack.enter_context(mmap.mmap(file.fileno(), _NOTE_BYTES))
        stop = stack.enter_context(CtrlC())
        threading.Thread(target=_listen, args=(stop,), daemon=True).start()
        try:
            config = load_config(given.settings, environ={}).config
            _say(said="begins")
            summary = run_session(
                config,
                observer=_Teller(progress).look,
                on_state=_change,
                stop=stop,
                tell=lambda said: _say(said=said),
            )
        except Exception as error:
            _say(ended=f"{type(error).__name__}: {error}")
            if isinstance(error, TegaError):
                return REFUSED
            raise
    _say(ended=summary["ended"], recording=summary.get("recording"), pacing=summary["pacing"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
