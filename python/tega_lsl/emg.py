"""Read EMG from a Lab Streaming Layer stream that another program puts on the network."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found, Options
from tega.devices.emg.live_emg import Arrived, LiveEmg, LiveEmgOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import LATE_S, Contradiction, Evidence, StampCheck, refuse
from tega_lsl.library import EXTRA, ClockCorrection, connected, load_lsl, to_monotonic_s

# Stamps further apart than this are a gap; below it they are the sender's jitter.
_GAP_S = 0.1
# Streams on one network answer at once; those that start late are found the next time.
_POLL_S = 1.5
_BUFFER_S = 10
_MOST_SAMPLES = 4096
# Types of streams and channels, as senders declare them, that are no muscles.
_OTHER_TYPE: Final = re.compile(
    r"acc|gyr|magnet|imu|trig|marker|count|stamp|time|qual|batt|gaze|mocap|position|orientation|temperature|audio",
    re.IGNORECASE,
)
_OTHER_LABEL: Final = re.compile(
    r"(acc|gyro?|mag)\w*[ _.-]?[xyz]|.*counter|.*time ?stamp|trigger|trg|markers?|battery", re.IGNORECASE
)


class LslEmgOptions(LiveEmgOptions, frozen=True, kw_only=True):
    """Settings of :class:`LslEmg`.

    Attributes:
        by: Property that selects the stream: ``name``, ``type`` or ``source_id``.
        value: Its name, type or source identifier.
        rate_hz: Samples per second, for a stream that states none; otherwise the stream's own counts.
        limits: Smallest and largest value of the amplifier, for saturation detection.
    """

    value: str
    by: Literal["name", "type", "source_id"] = "name"
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    limits: tuple[float, float] | None = None


class LslEmg(LiveEmg):
    """A stream of numbers found on the network; it is not asked to come back once it is gone."""

    name: ClassVar[str] = "lsl-emg"
    unit: ClassVar[str] = "as sent"
    unseen: ClassVar[str] = "no Lab Streaming Layer stream of type EMG was found"
    likelihood: ClassVar[int] = 2  # its program was started for it
    summary: ClassVar[str] = "any Lab Streaming Layer stream of numbers"
    extra: ClassVar[str] = EXTRA
    requires: ClassVar[tuple[str, ...]] = ("pylsl",)
    options_type: ClassVar[type[Options]] = LslEmgOptions
    free_columns: ClassVar[bool] = True
    compared: ClassVar[Mapping[Evidence, str]] = {
        "banner": "one stream of that name; its channels are declared as muscles, or not declared",
        "stamp": "the sender's clock, corrected every second, is this machine's; else arrival times are used",
        "rate": "the stated rate is the measured one",
        "values": "no channel is a counter or a time stamp; limits hold, where they are set",
    }
    _options: LslEmgOptions

    def __init__(self, options: LslEmgOptions) -> None:
        super().__init__(options, options.value.replace("/", "_").replace("\\", "_"))
        self._rate_hz, self.limits = options.rate_hz, options.limits
        self._inlet: Any = None
        self._lost_error: type[Exception] = Exception
        self._last_s: float | None = None
        self._arrived_s = 0.0
        self._correction: ClockCorrection | None = None
        self._stamps = StampCheck()
        self._to_monotonic_s = 0.0

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """List the network's streams of numbers whose stated type is EMG."""
        lsl = load_lsl(LslEmg.name)
        return [
            Found(
                driver=cls.name,
                label=f"{stream.name()} from {stream.hostname()}",
                options={"by": "source_id", "value": stream.source_id()}
                if stream.source_id()
                else {"by": "name", "value": stream.name()},
                note=f"{stream.channel_count()} channels at {stream.nominal_srate():g} Hz",
            )
            for stream in lsl.resolve_byprop("type", "EMG", minimum=0, timeout=min(timeout_s, _POLL_S))
            if stream.channel_format() != lsl.cf_string
        ]

    def _start(self) -> None:
        o = self._options
        lsl = load_lsl(LslEmg.name)
        hints = (
            "start the sender, and see that no firewall blocks it (UDP 16571, TCP 16572 to 16604)",
            "end the senders that are not meant" + ("" if o.by == "source_id" else ", or name a source_id"),
            "choose the amplifier's",
        )
        self._inlet, first_s, info = connected(
            lsl, self.name, o.by, o.value, start_s=o.start_s, buffer_s=_BUFFER_S, hints=hints
        )
        self._lost_error = lsl.util.LostError
        self._n_channels = int(info.channel_count())
        self._rate_hz = float(info.nominal_srate()) or o.rate_hz
        if self._rate_hz is None:
            raise DeviceUnavailableError(
                f"lsl-emg: {o.value!r} states no sample rate", "set rate_hz in its options"
            )
        declared = _undeclared(info, self._columns())
        self._to_monotonic_s = to_monotonic_s(lsl)
        self._correction = ClockCorrection(self._label, first_s, time.monotonic())
        self._stamps, self._last_s = StampCheck(), None
        self._contradictions.note("declared", declared)

    def _arrived(self) -> Arrived | None:
        if self._inlet is None:
            return None
        try:
            rows, stamps = self._inlet.pull_chunk(timeout=0.0, max_samples=_MOST_SAMPLES)
        except (self._lost_error, RuntimeError) as error:
            raise DeviceUnavailableError(
                f"lsl-emg: stream {self._options.value!r} was lost: {error}",
                "start its sender again, then this",
            ) from error
        if not stamps:
            return None
        samples: NDArray[np.float64] = np.asarray(rows, np.float64).reshape(len(stamps), self._n_channels)
        now_s, inlet, clock = time.monotonic(), self._inlet, self._correction
        correction_s = clock.follow(lambda: inlet.time_correction(timeout=0.1), now_s) if clock else 0.0
        taken_s = np.asarray(stamps, np.float64) + (correction_s + self._to_monotonic_s)
        is_believed = self._stamps.believes(float(taken_s[-1]), now_s)
        self._contradictions.note("stamp", self._stamps.contradiction)
        if not is_believed:
            self._last_s = None
            return Arrived(samples, None, time.monotonic_ns())
        delay_s = self._stamps.delay_s
        if delay_s is not None and delay_s > LATE_S:
            text = f"samples come {delay_s:.2f} s after their stamps"
            hint = "let the sender send at once, or stamp with its own lsl_local_clock()"
            refuse(self.name, self._label, Contradiction("stamp", text, hint))
        missing = self._missing(taken_s, now_s)
        return Arrived(samples, missing, min(round(taken_s[-1] * 1e9), time.monotonic_ns()))

    def _missing(self, taken_s: NDArray[np.float64], now_s: float) -> NDArray[np.int64]:
        """Return how many samples are missing before each by the stamps, if there was time for so many."""
        before = self._last_s if self._last_s is not None else taken_s[0]
        pause_s, self._arrived_s, self._last_s = now_s - self._arrived_s, now_s, float(taken_s[-1])
        rate_hz = self._rate_hz or 1.0
        steps = np.diff(taken_s, prepend=before)
        lost = np.where(steps > _GAP_S, np.maximum(np.rint(steps * rate_hz).astype(np.int64) - 1, 0), 0)
        return lost if lost.sum() <= (pause_s + _GAP_S) * rate_hz else np.zeros_like(lost)

    def _undecided(self) -> bool:
        return self._stamps.contradiction is None and self._stamps.delay_s is None

    def _own_notes(self) -> tuple[str, ...]:
        return () if self._correction is None else (self._correction.words(),)

    def _stop(self) -> None:
        if self._inlet is not None:
            self._inlet.close_stream()
        self._inlet = None


def _undeclared(info: Any, channels: Sequence[int]) -> Contradiction | None:
    """Return the contradiction of a stream that declares chosen channels, from 1, as something else than muscles."""
    hint = "set value to the amplifier's stream, or channels to its muscles"
    if _OTHER_TYPE.search(info.type()):
        return Contradiction("banner", f"the stream declares itself as {info.type()!r}, not as EMG", hint)
    channel, n = info.desc().child("channels").child("channel"), 1
    while not channel.empty():
        kind, label = channel.child_value("type"), channel.child_value("label")
        if n in channels and (_OTHER_TYPE.search(kind) or _OTHER_LABEL.fullmatch(label)):
            declared = " ".join(repr(word[:40]) for word in (label, kind) if word)
            return Contradiction("banner", f"channel {n} is declared as {declared}, not as a muscle", hint)
        channel, n = channel.next_sibling(), n + 1
    return None
