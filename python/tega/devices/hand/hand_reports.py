"""Define requests to a hand's loop and its reports, used in the driver's program and through pipes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega._native import WARM_C
from tega.hand.link import HandFault, HandSpoken, HandState


class HandNews(NamedTuple):
    """State of a hand and its loop. Angles are float64 (16,); ``None`` before the first.

    Attributes:
        fault: For which the hand was let go for good.
        target_rad: Target of the last cycle.
        ready: Whether the hand is steered, or never will be.
        trouble: Why the adapter went away, or the error that ended the loop.
        guard_problem: Why no guard would release the hand.
        n_garbled: Pieces of the adapter's stream that were no frame.
        n_unsent: Frames that the adapter did not take.
        cpu_s: Processor time of the loop's thread.
        let_go: Whether no motor was switched on, or the hand has confirmed that they are off.
        guard_pid: Number of the process that guards the hand; 0 while there is none.
    """

    state: HandState
    fault: HandFault | None = None
    angles_rad: NDArray[np.float64] | None = None
    target_rad: NDArray[np.float64] | None = None
    ready: bool = False
    trouble: str = ""
    guard_problem: str = ""
    n_garbled: int = 0
    n_unsent: int = 0
    cpu_s: float = 0.0
    ended: bool = False
    let_go: bool = False
    guard_pid: int = 0


Notify = Callable[[list[HandSpoken], HandNews], None]
"""Called with the exchanges since the last call and the state after them."""

LET_GO = 0.0
"""The word, in place of a level, that has the hand let go."""

WORD_S = 0.1
"""Interval at which a run sends a message, if necessary by repeating the last one."""

_STILL_S = 0.9


class HandOrders:
    """Requests of a run to a hand's loop, in the loop's own program.

    The run has to send messages regularly, since it may hang independently of the loop. ``requested`` is the
    closure level and its addition. ``reason`` is why the hand is let go although the run goes on; ``gone``:
    the run has ended without a message.
    """

    def __init__(self) -> None:
        self.requested: tuple[float, float] = (1, 0.0)
        self.leaving = threading.Event()
        self.gone, self.reason = False, ""
        self._n_words = 0
        self._last_s = time.monotonic()
        self._word = threading.Event()

    def take(self, word: float, added: float) -> None:
        """Take a level, or :data:`LET_GO`, and its addition; the loop sees both or neither."""
        if word == LET_GO:
            self.leaving.set()
        else:
            self.requested = word, added
        self._last_s = time.monotonic()
        self._n_words += 1
        self._word.set()

    def leave(self, reason: str) -> None:
        """Have the hand let go for a reason of this program's own."""
        self.reason = reason
        self.leaving.set()
        self._word.set()

    def lose(self) -> None:
        """Take note that the run is no more."""
        self.gone = True
        self.leave(self.reason)

    def pulse(self) -> tuple[int, float]:
        """Return how many words came, and for how long none has, seconds."""
        return self._n_words, time.monotonic() - self._last_s

    def still(self) -> bool:
        """Whether the run stands still: it has not left, and has sent nothing for nine tenths of a second."""
        return self.pulse()[1] > _STILL_S and not self.leaving.is_set()

    def await_word(self) -> None:
        """Wait until the run sends something or is no more."""
        while self.still():
            self._word.clear()
            self._word.wait(WORD_S)


_POLL_S = 0.1
_REPORTED_S = 1.0
# So many in a tenth of a second are a fault, and not a frame that a busy machine lost.
_MANY = 3
_WORDS = {
    "jumps": "joints jump; those angles are not used",
    "incomplete": "positions of a finger are missing",
    "malformed": "messages have a wrong length",
    "unknown": "unknown messages are on its bus",
    "copies": "frames come twice",
    "late": "its positions come late",
    "garbled": "its adapter sends noise",
    "unsent": "its adapter does not take frames, so it keeps its last torques",
}
_SILENT = "hand: silent; it has not confirmed the command to switch its motors off; reconnecting"
_UNSENT = f"hand: {_WORDS['unsent']}"
# A set of torques is one frame to each finger.
_FRAMES_A_SET = 4


class HandAlert:
    """Looks at a hand's own counts."""

    def __init__(self) -> None:
        self._next_s = self._until_s = 0.0
        self._counts: dict[str, int] = {}
        self._text = ""

    def __call__(self, seen: HandNews | None) -> str:
        """Return the current problem, for at least a second; ``""`` if there is none, or no report yet."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return self._text
        self._next_s = now_s + _POLL_S
        if text := "" if seen is None else self._check(seen):
            self._text, self._until_s = text, now_s + _REPORTED_S
        elif now_s >= self._until_s:
            self._text = ""
        return self._text

    def unsteered(self, seen: HandNews | None) -> str:
        """Return why the hand does not follow commands now, ``""`` if it does."""
        if seen is not None and seen.state.phase in {"silent", "listening", "identifying", "checking"}:
            return _SILENT
        return _UNSENT if self(seen) == _UNSENT else ""

    def _check(self, seen: HandNews) -> str:
        state = seen.state
        counts = {name: getattr(state.counts, name, 0) for name in _WORDS}
        counts |= {"garbled": seen.n_garbled, "unsent": seen.n_unsent // _FRAMES_A_SET}
        before, self._counts = self._counts, counts
        more = {name: n - before.get(name, n) for name, n in counts.items()}
        # Frames that do not reach the hand weigh more than any that come from it.
        name = "unsent" if more["unsent"] >= _MANY else max(more, key=lambda name: more[name])
        if more[name] >= _MANY:
            return f"hand: {_WORDS[name]}"
        if state.heat_share < 1:
            warmest_c = max((c for c in state.joints_c if c is not None), default=0)
            why = (
                f"a joint is at {warmest_c} °C"
                if warmest_c > WARM_C
                else "it warns, or a temperature or its status is missing"
            )
            return f"hand: its torque is limited to {100 * state.heat_share:.0f} %: {why}"
        return ""
