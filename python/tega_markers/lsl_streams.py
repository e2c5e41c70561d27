"""Send the numbers of a run as streams of the Lab Streaming Layer: EMG, closure, touch, vest and poses.

Channels, their names and their units are those of the records (:mod:`tega.records`), without times and texts. A number
that is not there, such as the force of a metric that measures none, is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

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
from tega.runtime.lsl import load_lsl, to_monotonic_s
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
        # A decoder may tell a muscle's activity in some records only; a stream's channels are fixed.
        if rows and len(rows[0]) == n_channels:
            outlet.push_chunk(rows, self._at_ns(getattr(record, "t_ns", 0)) * 1e-9 + self._to_lsl_s)
            self.n_pushed[name] = self.n_pushed.get(name, 0) + len(rows)

    def _outlet(self, name: str, record: Record) -> tuple[Any, int]:
        """Announce a stream with the names and units of its channels."""
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
    """Return name and unit of every channel."""
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
