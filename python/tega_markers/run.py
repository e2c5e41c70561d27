"""Join a run: send its markers to other programs, and record theirs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from tega.loop.parts import Part, PartContext, RunStart
from tega.records import Alert, Button, Event, HeardMarker, Record, RunState
from tega.records.bus import Backlog, Bus
from tega_lsl.library import load_lsl, to_monotonic_s
from tega_markers.lsl_streams import LslMarkersIn, LslStreams, ReceivedMarker
from tega_markers.settings import MarkersSection

# What was pushed last is on its way when the stream is taken away.
_LINGER_S = 0.2
# Sent again to each client that connects later.
_STANDING = ("session", "trial", "state")


class LslMarkersOut:
    """An outlet of one text channel of irregular rate, type ``Markers``, source identifier ``tega-NAME``.

    Stamps are this machine's LSL clock (``lsl_local_clock``, seconds) at the marked moment, not at that of
    sending; on Linux that is the monotonic clock that a run counts from. Streams take a second to find each
    other, and earlier markers are lost: a new listener gets the present states, with the times at which they
    began.
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


class MarkersPart(Part):
    """Sends markers of a run, and records markers of other programs.

    Create it early: streams take a second to find each other.

    =====================  ==========================================================
    marker                 when
    =====================  ==========================================================
    ``session:start``      at the zero of the session's times
    ``trial:NAME``         likewise; the recording's name without ending, or ``start``
    ``state:STATE``        at every change of the run's state
    ``fault:NAME:WORDS``   when something goes wrong
    ``fault-over:NAME``    when it has recovered
    ``pedal:BUTTON``       when a button of the seat ``marker`` goes down
    ``touch:KIND:FINGER``  when a finger touches (``contact``), lets go (``release``), or ``touch:slip``
    =====================  ==========================================================
    """

    def __init__(self, settings: MarkersSection, bus: Bus) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._early: list[ReceivedMarker] = []
        self._bus = bus
        self._zero_ns = self._start_ns = 0
        self._counts_real = self._begun = False
        self._waiting = Backlog("markers")
        self._out = None if settings.lsl_out is None else LslMarkersOut(settings.lsl_out)
        self._in = None if settings.lsl_in is None else LslMarkersIn(settings.lsl_in, self._received)
        self._streams: LslStreams | None = None
        if settings.lsl_streams:
            prefix = settings.lsl_out or "tega"
            self._streams = LslStreams(settings.lsl_streams, prefix, bus, self._waiting, at_ns=self._at_ns)
        if self._out is not None:
            reported: tuple[tuple[type[Record], Any], ...] = (
                (RunState, self._state),
                (Alert, self._alert),
                (Button, self._button),
                (Event, self._event),
            )
            for kind, mark in reported:
                bus.subscribe(kind, mark, name="markers", backlog=self._waiting)

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of the streams."""
        return {"markers": self._problem}

    def _problem(self) -> str:
        """Return why no markers are received, ``""`` without a problem; it also detects new listeners."""
        if self._out is not None:
            self._out.greet()
        return "" if self._in is None else self._in.problem

    def begin(self, run: RunStart) -> None:
        """Send that session and trial begin."""
        with self._lock:
            self._counts_real, self._zero_ns = run.real, run.start_ns
            self._start_ns = run.start_ns if run.real else time.monotonic_ns()
            self._begun = True
            early, self._early = self._early, []
        for received in early:
            self._received(received)
        if self._streams is not None:
            muscles = run.prepared.muscles
            self._streams.begin(None if muscles is None else muscles.source.info.rate_hz)
        self._notify("session:start", self._start_ns)
        self._notify(f"trial:{run.trial}", self._start_ns)

    def finish(self, summary: dict[str, Any]) -> None:
        """Add the counts of markers sent and received, those of the last markers included."""
        counts: dict[str, Any] = {}
        if self._out is not None:
            counts["out"] = {"stream": self._settings.lsl_out, "sent": self._out.n_pushed}
        if self._streams is not None:
            counts["streams"] = dict(self._streams.n_pushed)
        if self._in is not None:
            counts["in"] = {
                "stream": self._settings.lsl_in,
                "heard": self._in.n_received,
                "of_another_clock": self._in.n_unstamped,
                "clock_correction_s": self._in.correction_s,
                "problem": self._in.problem,
            }
        summary["markers"] = counts

    def close(self) -> None:
        """Stop listening, and take the own stream away."""
        self._waiting.close()
        if self._streams is not None:
            self._streams.close()
        if self._in is not None:
            self._in.close()
        if self._out is not None:
            self._out.close()

    def _notify(self, text: str, at_ns: int) -> None:
        if self._out is not None:
            self._out.push(text, at_ns)

    def _state(self, change: RunState) -> None:
        self._notify(f"state:{change.state}", self._at_ns(change.t_ns))

    def _alert(self, alert: Alert) -> None:
        words = f"fault:{alert.name}:{alert.said}" if alert.said else f"fault-over:{alert.name}"
        self._notify(words, self._at_ns(alert.t_ns))

    def _button(self, button: Button) -> None:
        if button.seat == "marker" and button.pressed:
            # Devices stamp with the monotonic clock, whatever the session counts from.
            self._notify(f"pedal:{button.button}", self._zero_ns + button.t_ns)

    def _event(self, event: Event) -> None:
        self._notify(f"touch:{event.kind}:{event.finger}".rstrip(":"), self._at_ns(event.t_ns))

    def _at_ns(self, t_ns: int) -> int:
        """Return when on the monotonic clock a time of the session was; now, where that is no real time."""
        if self._counts_real:
            return self._start_ns + t_ns
        return time.monotonic_ns() - round(self._waiting.waited_s * 1e9)

    def _received(self, received: ReceivedMarker) -> None:
        with self._lock:
            if not self._begun:
                self._early.append(received)
                return
        start_ns = self._start_ns
        marker = HeardMarker(
            t_ns=received.at_ns - start_ns,
            received_ns=received.received_ns - start_ns,
            text=received.text,
            source=f"lsl:{self._settings.lsl_in}",
            stamp_s=received.stamp_s,
            correction_s=received.correction_s,
        )
        self._bus.publish(marker)


def open_part(context: PartContext) -> MarkersPart | None:
    """Open the streams of markers; ``None`` where the settings name none."""
    settings = context.config.guests.get("markers")
    if settings is None or settings == MarkersSection():
        return None
    part = MarkersPart(settings, context.bus)
    context.stack.callback(part.close)
    return part
