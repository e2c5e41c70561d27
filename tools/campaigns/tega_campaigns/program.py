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
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tega.config import load_config
from tega.errors import TegaError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import RunState
from tega.records.bus import Bus
from tega.records.display import Notice
from tega.safety.stop import CtrlC
from tega_emulators.hid_port import HidBoard, HidPort

__all__ = ["REFUSED", "main", "noted_tick_ns"]

REFUSED = 3
"""Exit code of a run that a :class:`~tega.errors.TegaError` has ended."""

_EVERY_S, _COUNTS_S = 0.5, 0.1
_NOTE_BYTES = 8
_PAGE_MIB = os.sysconf("SC_PAGE_SIZE") / 2**20 if hasattr(os, "sysconf") else 0.0
_MEMORY = Path("/proc/self/statm")


class _Teller:
    """Prints what has changed, and notes how far the loop has come.

    ``progress`` is memory of a file that a kill leaves; ``None`` for no note. ``counts`` returns what the
    station did with commands; ``None`` where nobody looks on.
    """

    def __init__(self, progress: mmap.mmap | None, counts: Callable[[], dict[str, Any]] | None) -> None:
        self._key = ""
        self._next_s = 0.0
        self._progress, self._counts = progress, counts

    def check(self, view: LoopView) -> None:
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
        self._key, self._next_s = key, now_s + (_EVERY_S if self._counts is None else _COUNTS_S)
        _say(
            state=view.state,
            reason=view.reason,
            alerts=list(view.alerts),
            arm=arm,
            felt=felt,
            no_data=any("no data from the robot" in alert for alert in view.alerts),
            rss_mib=_rss_mib(),
            **({} if self._counts is None else self._counts()),
        )


def noted_tick_ns(path: Path) -> int:
    """Return how far a run had come as it noted itself in a file; -1 where it had not begun."""
    data = path.read_bytes() if path.exists() else b""
    return int(struct.unpack("<q", data)[0]) if len(data) == _NOTE_BYTES else -1


def _say(**subject: Any) -> None:
    sys.stdout.write(json.dumps({"at_s": time.monotonic(), **subject}) + "\n")
    sys.stdout.flush()


def _change(change: RunState) -> None:
    _say(state=change.state, reason=change.reason)


def _rss_mib() -> float:
    """Return the resident memory; 0 where the system does not report it."""
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
    counts = None
    if given.commands:
        from tega_campaigns.judged_commands import measure_beside_on  # which brings the link's packages

        counts = measure_beside_on()
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
            bus, teller = Bus(), _Teller(progress, counts)
            bus.subscribe(Snapshot, lambda snapshot: teller.check(snapshot.view), name="display", vital=True)
            bus.subscribe(RunState, _change, name="states", vital=True)
            bus.subscribe(Notice, lambda notice: _say(said=notice.text), name="notices")
            summary = run_session(config, controls=Controls(stop=stop), bus=bus)
        except Exception as error:
            _say(ended=f"{type(error).__name__}: {error}")
            if isinstance(error, TegaError):
                return REFUSED
            raise
    _say(ended=summary["ended"], recording=summary.get("recording"), pacing=summary["pacing"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
