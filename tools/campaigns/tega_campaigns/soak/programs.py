"""The programs under test, one run or the stations of robot and operator, and the operator: a foot, and an arm."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from tega.errors import TegaError
from tega.runtime.clock import every
from tega_campaigns.supervisor import SaidLine, Supervisor
from tega_emulators.lab import EmulatedLab

__all__ = ["Programs", "SoakOperator"]


class Programs(AbstractContextManager["Programs"]):
    """Supervisors by program, in the order of their starts; the first has hand, arm and recorder."""

    def __init__(self, parts: Mapping[str, Supervisor]) -> None:
        self._parts = dict(parts)
        self.main = next(iter(self._parts.values()))

    def __exit__(self, *_error: object) -> None:
        """End what still runs."""
        for part in reversed(self._parts.values()):
            part.__exit__()

    def __getitem__(self, name: str) -> Supervisor:
        """Return the supervisor of one; with one program it goes by any name."""
        return self._parts.get(name, self.main)

    @property
    def alive(self) -> bool:
        """Whether all of them run."""
        return all(part.alive for part in self._parts.values())

    def well(self, since_s: float = 0.0) -> bool:
        """Whether all of them run, have reported since then, are active, and nothing but latency is wrong."""
        return all(part.well(since_s) for part in self._parts.values()) and self.main.leads

    @property
    def reported(self) -> Mapping[str, Any]:
        """The latest report of the first of them."""
        return self.main.now

    def lines(self, since_s: float) -> list[SaidLine]:
        """Return what all of them have printed since a moment, oldest first."""
        found = (line for part in self._parts.values() for line in part.backwards(since_s))
        return sorted(found, key=lambda line: line.at_s)

    def start(self) -> None:
        """Start those that do not run."""
        for part in self._parts.values():
            if not part.alive:
                part.end()
                part.start()

    def end(self) -> int:
        """Ask all of them to end, the last one first, and return the first exit code that is none of success."""
        return next(filter(None, [part.end() for part in reversed(list(self._parts.values()))]), 0)

    def notify(self, line: str) -> None:
        """Give all of them a line of their standard input."""
        for part in self._parts.values():
            part.notify(line)

    @property
    def memory(self) -> list[list[tuple[float, float]]]:
        """Resident memory of every process there was, as (time, MiB)."""
        return [process for part in self._parts.values() for process in part.memory]

    @property
    def now(self) -> str:
        """The latest report of each of them, for people."""
        return "; ".join(f"{name}: {part.now}" for name, part in self._parts.items())

    @property
    def last_words(self) -> str:
        """The last line of each that does not run."""
        found = []
        for name, part in self._parts.items():
            line = next(part.backwards(part.started_s), None)
            if not part.alive and line is not None:
                text = line.said
                found.append(f"{name}: {text.get('ended') or text}")
        return "; ".join(found) or "it said nothing; see errors.log"


_POLL_S = 0.5
_LET_GO_S = 0.15
_SWING = "wave 0.06 0.2"
_DEAD_MAN, _RECOVER = 0, 1


class SoakOperator:
    """Holds the pedal down; takes hold of an arm that does not follow, and recovers one that has stopped.

    ``lab`` has pedal and headset; ``reported`` returns the program's latest report. ``waits`` is whether
    something is broken on purpose, so that there is nothing to take hold of.
    """

    def __init__(self, lab: EmulatedLab, reported: Callable[[], Mapping[str, Any]]) -> None:
        self._lab, self._reported = lab, reported
        self.waits = False

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Be there for as long as the block lasts."""
        self._lab.headset.say(_SWING)
        with every(self._check, every_s=_POLL_S):
            yield

    def _check(self) -> None:
        reported = self._reported()
        if self.waits or reported.get("arm", "").startswith("following"):
            return
        with contextlib.suppress(TegaError):  # the emulator has ended
            self._take_hold(stopped=reported.get("arm", "").startswith("stopped"))

    def _take_hold(self, *, stopped: bool) -> None:
        pedal = self._lab.pedal
        pedal.say(f"lift {_DEAD_MAN}")
        time.sleep(_LET_GO_S)
        if stopped:
            pedal.say(f"press {_RECOVER}")
            time.sleep(_LET_GO_S)
            pedal.say(f"lift {_RECOVER}")
        pedal.say(f"press {_DEAD_MAN}")
