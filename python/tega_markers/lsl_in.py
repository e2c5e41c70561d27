"""Listen to another program's markers, and convert their times to this machine's clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from tega.runtime.lsl import load_lsl, to_monotonic_s

_LOOK_S = 0.5
_WAIT_S = 0.2
_CONNECT_S = 5.0
_BUFFER_S = 60


class Heard(NamedTuple):
    """A marker that came.

    Attributes:
        at_ns: When it was set, on this machine's monotonic clock.
        received_ns: When it came, on the same.
        text: What it says; numbers are written out.
        stamp_s: Its stamp as it came, by the sender's clock.
        correction_s: What was added to that to get this machine's LSL clock.
    """

    at_ns: int
    received_ns: int
    text: str
    stamp_s: float
    correction_s: float


class LslMarkersIn:
    """Listens in a thread of its own; a stream that is not there yet, or goes away, is looked for all the time.

    Args:
        name: What the stream is called.
        hear: Told of each marker, in that thread.

    Attributes:
        problem: What is wrong, one sentence; ``""`` while the stream is there.
        n_heard: Markers so far.
        correction_s: The newest correction of the sender's clock; ``None`` before the first marker.

    Raises:
        MissingExtraError: pylsl is not installed.
    """

    def __init__(self, name: str, hear: Callable[[Heard], None]) -> None:
        self._name = name
        self._hear = hear
        self._lsl = load_lsl("markers.lsl_in")
        self._over = threading.Event()
        self.problem = f"markers: no stream called {name!r} on the network yet"
        self.n_heard = 0
        self.correction_s: float | None = None
        self._thread = threading.Thread(target=self._work, name="tega-markers", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take in what has come, and stop listening."""
        self._over.set()
        self._thread.join(_CONNECT_S)

    def _work(self) -> None:
        lsl = self._lsl
        while not self._over.is_set():
            found = lsl.resolve_byprop("name", self._name, minimum=1, timeout=_LOOK_S)
            if not found:
                continue
            try:
                self._listen(found[0])
            except (lsl.util.LostError, RuntimeError, TimeoutError) as error:
                self.problem = f"markers: stream {self._name!r} was lost: {error}; it is looked for"

    def _listen(self, stream: Any) -> None:
        inlet = self._lsl.StreamInlet(stream, max_buflen=_BUFFER_S, recover=False)
        try:
            inlet.open_stream(timeout=_CONNECT_S)
            inlet.time_correction(timeout=_CONNECT_S)
            self.problem = ""
            while not self._over.is_set():
                self._pull(inlet, _WAIT_S)
            # What was set while the clocks were still compared, or came since the last look, belongs to the run.
            while self._pull(inlet, 0.0):
                pass
        finally:
            inlet.close_stream()

    def _pull(self, inlet: Any, wait_s: float) -> bool:
        """Take the next marker, once there is one; tell whether there was."""
        values, stamp_s = inlet.pull_sample(timeout=wait_s)
        if values is not None:
            self._take(" ".join(map(str, values)), float(stamp_s), float(inlet.time_correction()))
        return values is not None

    def _take(self, text: str, stamp_s: float, correction_s: float) -> None:
        self.correction_s = correction_s
        self.n_heard += 1
        at_ns = round((stamp_s + correction_s + to_monotonic_s(self._lsl)) * 1e9)
        self._hear(Heard(at_ns, time.monotonic_ns(), text, stamp_s, correction_s))
