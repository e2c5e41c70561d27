"""Listen to another program's markers, and send the numbers of a run as streams, by the Lab Streaming Layer.

Times of markers become those of this machine's clock. Streams are EMG, closure, touch, vest and poses; channels, their
names and their units are those of the records (:mod:`tega.records`), without times and texts. A number that is not
there, such as the force of a metric that measures none, is NaN.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from tega.records import (
    ArmMeasured,
    ArmTarget,
    Contact,
    EmgSamples,
    ForearmPose,
    Intent,
    Record,
    SentFrame,
    VestFrame,
)
from tega.records.bus import Backlog, Bus
from tega.records.schema import MessageField, fields
from tega.runtime.evidence import is_other_clock
from tega.runtime.marker_budget import MarkerBudget
from tega_lsl.library import find_streams, hosts_of, load_lsl, to_monotonic_s
from tega_markers.settings import LslStreamName

_KINDS: Final[Mapping[LslStreamName, tuple[type[Record], ...]]] = {
    "emg": (EmgSamples,),
    "closure": (Intent,),
    "touch": (Contact,),
    "vest": (VestFrame, SentFrame),
    "poses": (ForearmPose, ArmMeasured, ArmTarget),
}
_TYPES: Final[Mapping[LslStreamName, str]] = {"emg": "EMG", "poses": "MoCap"}
_NUMBERS: Final = frozenset({"double", "float", "int32", "int64", "uint32", "bool"})

_POLL_S = 0.5
_WAIT_S = 0.2
_CONNECT_S = 5.0
_BUFFER_S = 60
# A moment may be marked a little before it comes, such as the next picture's, and up to a minute after it was.
_AHEAD_S = 1.0
_AWAY_S = 60.0
# A stream that is gone is no second one of its name after so long.
_FORGET_S = 2.0


class LslStreams:
    """Makes a stream of a topic when its first record comes, named as it is: ``tega/tactile/thumb/contact``.

    Stamps are this machine's LSL clock at the moment of each record. Samples of EMG keep the rate that the
    source states; all other streams have an irregular rate. Every stream's name begins with ``prefix``.
    Records wait in ``backlog``, so that a slow network delays no loop. ``at_ns`` turns a time of the session
    into one of the monotonic clock. ``n_pushed`` counts the samples sent so far, by stream.
    """

    def __init__(
        self,
        names: tuple[LslStreamName, ...],
        prefix: str,
        bus: Bus,
        backlog: Backlog,
        *,
        at_ns: Callable[[int], int],
    ) -> None:
        self._lsl, self._prefix, self._at_ns = load_lsl("markers.lsl_streams"), prefix, at_ns
        self._to_lsl_s = -to_monotonic_s(self._lsl)
        self._outlets: dict[str, tuple[Any, int]] = {}
        self._emg_hz: float | None = None
        self.n_pushed: dict[str, int] = {}
        for name in dict.fromkeys(names):
            for kind in _KINDS[name]:
                bus.subscribe(kind, self._send, name="lsl streams", backlog=backlog)
        self._types = {kind: _TYPES.get(name, "TEGA") for name in names for kind in _KINDS[name]}

    def begin(self, emg_hz: float | None) -> None:
        """Begin to send."""
        self._emg_hz = emg_hz or self._lsl.IRREGULAR_RATE

    def close(self) -> None:
        """Take the streams away."""
        self._outlets.clear()

    def _send(self, record: Record) -> None:
        if self._emg_hz is None:
            return
        if isinstance(record, EmgSamples):
            rows = record.samples.reshape(-1, record.n_channels).tolist()
        else:
            rows = [[number for _, numbers in _channels(record) for number in numbers]]
        name = f"{self._prefix}{record.where}"
        if name not in self._outlets:
            self._outlets[name] = self._outlet(name, record)
        outlet, n_channels = self._outlets[name]
        # A decoder may report a muscle's activity in some records only; a stream's channels are fixed.
        if rows and len(rows[0]) == n_channels:
            outlet.push_chunk(rows, self._at_ns(getattr(record, "t_ns", 0)) * 1e-9 + self._to_lsl_s)
            self.n_pushed[name] = self.n_pushed.get(name, 0) + len(rows)

    def _outlet(self, name: str, record: Record) -> tuple[Any, int]:
        lsl, labels = self._lsl, _labels(record)
        rate_hz = self._emg_hz if isinstance(record, EmgSamples) else lsl.IRREGULAR_RATE
        info = lsl.StreamInfo(
            name, self._types[type(record)], len(labels), rate_hz, "double64", f"tega-{name}"
        )
        channels = info.desc().append_child("channels")
        for label, unit in labels:
            channel = channels.append_child("channel")
            channel.append_child_value("label", label)
            channel.append_child_value("unit", unit)
        return lsl.StreamOutlet(info), len(labels)


def _labels(record: Record) -> list[tuple[str, str]]:
    if isinstance(record, EmgSamples):
        unit = next(field.unit for field in fields(EmgSamples) if field.array)
        return [(f"ch{k + 1}", unit) for k in range(record.n_channels)]
    return [
        (field.name if len(numbers) == 1 else f"{field.name}{k + 1}", field.unit)
        for field, numbers in _channels(record)
        for k in range(len(numbers))
    ]


def _channels(record: Record) -> list[tuple[MessageField, list[float]]]:
    """Return the numbers of each field that is no time and no text."""
    found = []
    for field in fields(type(record)):
        if field.wire not in _NUMBERS or field.unit == "ns":
            continue
        value = getattr(record, field.attribute)
        if field.of_pair is not None:
            value = value[field.of_pair]
        numbers = value if field.repeated else (value,)
        found.append((field, [math.nan if one is None else float(one) for one in numbers]))
    return found


class ReceivedMarker(NamedTuple):
    """A marker that came.

    ``at_ns`` is when it was set, on this machine's monotonic clock; when it came (``received_ns``), where its
    stamp is of another clock. Numbers are written out in ``text``. ``stamp_s`` is by the sender's clock as it
    came; ``correction_s`` was added to it to get this machine's LSL clock.
    """

    at_ns: int
    received_ns: int
    text: str
    stamp_s: float
    correction_s: float


class LslMarkersIn:
    """Listens in a thread of its own; a stream that is not there, or goes away, is looked for all the time.

    Two streams of one name are refused: one of them may be what an experiment that crashed has left behind.
    ``receive`` is called with each marker, in that thread.

    Attributes:
        problem: One sentence; ``""`` while exactly one stream is there and its stamps are plausible.
        n_unstamped: Markers so far with stamps of another clock.
        correction_s: The newest correction of the sender's clock; ``None`` before the first marker.
    """

    def __init__(self, name: str, receive: Callable[[ReceivedMarker], None]) -> None:
        self._name = name
        self._receive = receive
        self._lsl = load_lsl("markers.lsl_in")
        self._over = threading.Event()
        self.problem = f"markers: no stream called {name!r} on the network yet"
        self.n_received = self.n_unstamped = 0
        self.budget = MarkerBudget()
        self.correction_s: float | None = None
        self._marker_problem = ""
        self._thread = threading.Thread(target=self._work, name="tega-markers", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take in what has come, and stop listening."""
        self._over.set()
        self._thread.join(_CONNECT_S)

    def _work(self) -> None:
        lsl = self._lsl
        while not self._over.is_set():
            found = find_streams(lsl, "name", self._name, _POLL_S)
            if len(found) > 1:
                self.problem = self._several(found)
            if len(found) != 1:
                continue
            try:
                self._listen(found[0])
            # A TypeError is a stream whose description the library cannot read.
            except (lsl.util.LostError, RuntimeError, TimeoutError, TypeError) as error:
                self.problem = f"markers: stream {self._name!r} was lost: {error}; it is looked for"

    def _several(self, found: list[Any]) -> str:
        return (
            f"markers: {len(found)} streams are called {self._name!r}, from {hosts_of(found)}: "
            "end the one that is not meant"
        )

    def _listen(self, stream: Any) -> None:
        inlet = self._lsl.StreamInlet(stream, max_buflen=_BUFFER_S, recover=False)
        others = self._lsl.ContinuousResolver("name", self._name, forget_after=_FORGET_S)
        try:
            inlet.open_stream(timeout=_CONNECT_S)
            inlet.time_correction(timeout=_CONNECT_S)
            self._marker_problem = ""
            while not self._over.is_set():
                there = list({one.uid(): one for one in [stream, *others.results()]}.values())
                self.problem = self._several(there) if len(there) > 1 else self._marker_problem
                self._pull(inlet, _WAIT_S)
            # What was set while the clocks were still compared, or came since the last look, belongs to the run.
            while self._pull(inlet, 0.0):
                pass
        finally:
            inlet.close_stream()

    def _pull(self, inlet: Any, wait_s: float) -> bool:
        """Process the next marker, once there is one; return whether there was."""
        try:
            values, stamp_s = inlet.pull_sample(timeout=wait_s)
        except UnicodeDecodeError as error:  # it has the text, the stamp is lost
            text = error.object.decode(errors="replace")
            self._take(text, math.nan, float(inlet.time_correction()))
            self._marker_problem = (
                f"markers: {self._name!r} sends {text[:40]!r}, which is not UTF-8: the marker is recorded with its "
                "arrival; let the sender encode texts as UTF-8"
            )
            return True
        if values is not None:
            self._take(" ".join(map(str, values)), float(stamp_s), float(inlet.time_correction()))
        return values is not None

    def _take(self, text: str, stamp_s: float, correction_s: float) -> None:
        self.correction_s = correction_s
        self.n_received += 1
        received_ns = time.monotonic_ns()
        at_s = stamp_s + correction_s + to_monotonic_s(self._lsl)
        age_s = received_ns * 1e-9 - at_s
        self._marker_problem = ""
        if why := self.budget.problem(text):
            self._marker_problem = f"markers: {self._name!r}: {why}"
            return
        if math.isnan(at_s) or is_other_clock(age_s, ahead_s=_AHEAD_S, away_s=_AWAY_S):
            self.n_unstamped += 1
            self._marker_problem = (
                f"markers: {self._name!r} stamps {text[:40]!r} with {stamp_s:.3f} s, which is of another clock: "
                "the marker is recorded with its arrival; stamp with lsl_local_clock(), or leave the stamp out"
            )
            at_ns = received_ns
        else:
            at_ns = round(at_s * 1e9)
        self._receive(ReceivedMarker(at_ns, received_ns, text, stamp_s, correction_s))
