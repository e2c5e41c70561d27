"""The program under test: a run from its settings, as ``tega-teleop run`` makes it, that says how it is.

``python -m tega_campaigns.soak.system SETTINGS.toml`` writes a line of JSON whenever the state or an alert changes and
twice a second, and at last one with ``ended``. A line ``clock 3600`` on its standard input sets its time of day
forward, as somebody who sets the computer's clock would; the end of its input ends the run.
"""

from __future__ import annotations

import json
import os
import re
import sys
import threading
import time
from pathlib import Path
from typing import Any

from tega.config import load_config
from tega.safety.ctrl_c import CtrlC
from tega.safety.states import Transition
from tega.teleop import run_session
from tega.teleop.moment import LoopView

__all__ = ["main"]

_EVERY_S = 0.5
_PAGE_MIB = os.sysconf("SC_PAGE_SIZE") / 2**20 if hasattr(os, "sysconf") else 0.0


class _Said:
    """What was said last, so that only news is said."""

    def __init__(self) -> None:
        self._key = ""
        self._next_s = 0.0

    def look(self, view: LoopView) -> None:
        now_s = time.monotonic()
        # Numbers that count up, such as for how long a picture is missing, are no news.
        arm = "" if view.seen_arm is None else f"{view.seen_arm.state}: {view.seen_arm.reason}"
        key = re.sub(r"[\d.]+", "#", f"{view.state} {view.reason} {view.alerts} {arm}")
        if key == self._key and now_s < self._next_s:
            return
        self._key, self._next_s = key, now_s + _EVERY_S
        say(state=view.state, reason=view.reason, alerts=list(view.alerts), arm=arm, rss_mib=_rss_mib())

    def change(self, change: Transition) -> None:
        say(state=change.state, reason=change.reason)


def say(**what: Any) -> None:
    """Write a line."""
    sys.stdout.write(json.dumps({"at_s": time.monotonic(), **what}) + "\n")
    sys.stdout.flush()


def _rss_mib() -> float:
    with Path("/proc/self/statm").open(encoding="ascii") as file:
        return int(file.read().split()[1]) * _PAGE_MIB


def _listen(stop: CtrlC) -> None:
    true_ns, offset_ns = time.time_ns, 0
    for line in sys.stdin:
        verb, _, seconds = line.strip().partition(" ")
        if verb == "clock":
            # Nobody but the machine's owner may set its clock; this process is shown another one.
            offset_ns += round(float(seconds) * 1e9)
            time.time_ns = lambda: true_ns() + offset_ns  # noqa: B023
            time.time = lambda: (true_ns() + offset_ns) / 1e9  # noqa: B023
    stop.ask("the soak is over")


def main() -> None:
    """Run until the standard input ends."""
    sys.setswitchinterval(0.0005)  # as in ``run``
    said = _Said()
    with CtrlC() as stop:
        threading.Thread(target=_listen, args=(stop,), daemon=True).start()
        try:
            summary = run_session(
                load_config(Path(sys.argv[1])).config,
                observer=said.look,
                on_state=said.change,
                stop=stop,
            )
        except Exception as error:
            say(ended=f"{type(error).__name__}: {error}")
            raise
    say(ended=summary["ended"], recording=summary.get("recording"), pacing=summary["pacing"])


if __name__ == "__main__":
    main()
