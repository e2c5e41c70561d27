"""Send a stream of texts that mark the events of a run, each with the time at which it happened."""

from __future__ import annotations

import threading
import time

from tega.runtime.lsl import load_lsl, to_monotonic_s

# What was pushed last is on its way when the stream is taken away.
_LINGER_S = 0.2
# Told again to who comes later.
_STANDING = ("session", "trial", "state")


class LslMarkersOut:
    """An outlet of one text channel of irregular rate, type ``Markers``.

    Stamps are this machine's LSL clock (``lsl_local_clock``, seconds) at the marked moment, not at that of sending;
    on Linux that is the monotonic clock that a run counts from. Streams take a second to find each other, and earlier
    markers are lost: a new listener gets the present states, with the times at which they began.

    Args:
        name: Name of the stream; its source identifier is ``tega-NAME``.

    Raises:
        MissingExtraError: pylsl is not installed.
    """

    def __init__(self, name: str) -> None:
        lsl = load_lsl("markers.lsl_out")
        info = lsl.StreamInfo(name, "Markers", 1, lsl.IRREGULAR_RATE, "string", f"tega-{name}")
        clock = info.desc().append_child("clock")
        clock.append_child_value("name", "lsl_local_clock")
        clock.append_child_value("unit", "seconds")
        clock.append_child_value(
            "stamps", "when it happened; session:start is the zero of the session's times"
        )
        self._outlet = lsl.StreamOutlet(info)
        self._to_lsl_s = -to_monotonic_s(lsl)
        self._standing: dict[str, tuple[str, int]] = {}
        self._received = False
        self._lock = threading.Lock()  # the loop greets, the markers' backlog pushes
        self.n_pushed = 0

    def push(self, text: str, at_ns: int) -> None:
        """Mark a moment; returns at once."""
        self.greet()
        with self._lock:
            self._push(text, at_ns)
            kind = text.partition(":")[0]
            if kind in _STANDING:
                self._standing[kind] = text, at_ns

    def greet(self) -> None:
        """Send the present states if a listener has connected; returns at once."""
        with self._lock:
            received, self._received = self._received, bool(self._outlet.have_consumers())
            if self._received and not received:
                for text, at_ns in self._standing.values():
                    self._push(text, at_ns)

    def _push(self, text: str, at_ns: int) -> None:
        self._outlet.push_sample([text], at_ns * 1e-9 + self._to_lsl_s)
        self.n_pushed += 1

    def close(self) -> None:
        """Remove the stream, after a pause in which listeners receive its end."""
        if self._outlet is not None and self._outlet.have_consumers():
            time.sleep(_LINGER_S)
        self._outlet = None
