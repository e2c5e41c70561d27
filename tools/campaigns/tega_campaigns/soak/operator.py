"""The operator of a soak: a foot on the pedal, and an arm that swings."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from tega.errors import TegaError
from tega.runtime.clock import every
from tega_emulators.lab import EmulatedLab

__all__ = ["SoakOperator"]

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
