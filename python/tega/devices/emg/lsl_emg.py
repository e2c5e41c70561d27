"""Read EMG from a Lab Streaming Layer stream that another program puts on the network."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np

from tega.devices.base import Found, Options
from tega.devices.emg.live_emg import Arrived, LiveEmg, LiveEmgOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.lsl import EXTRA, load_lsl, to_monotonic_s

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Stamps further apart than this are a gap; below it they are the sender's jitter.
_GAP_S = 0.1
# Streams on one network answer at once; those that start late are found the next time.
_LOOK_S = 1.5
_BUFFER_S = 10
_MOST_SAMPLES = 4096


class LslEmgOptions(LiveEmgOptions, frozen=True, kw_only=True):
    """Settings of :class:`LslEmg`.

    Attributes:
        by: What the stream is known by: ``name``, ``type`` or ``source_id``.
        value: Its name, type or source identifier.
        rate_hz: Samples per second, for a stream that states none; otherwise the stream's own counts.
        limits: Smallest and largest value of the amplifier, so that saturation can be told.
    """

    value: str
    by: Literal["name", "type", "source_id"] = "name"
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    limits: tuple[float, float] | None = None


class LslEmg(LiveEmg):
    """A stream of numbers found on the network; it is not asked to come back once it is gone."""

    name: ClassVar[str] = "lsl-emg"
    summary: ClassVar[str] = "any Lab Streaming Layer stream of numbers"
    extra: ClassVar[str] = EXTRA
    requires: ClassVar[tuple[str, ...]] = ("pylsl",)
    options_type: ClassVar[type[Options]] = LslEmgOptions

    def __init__(self, options: LslEmgOptions) -> None:
        super().__init__(options)
        self._options = options
        self._inlet: Any = None
        self._lost_error: type[Exception] = Exception
        self._n_channels = 0
        self._stated_hz = options.rate_hz
        self._last_s: float | None = None
        self._correction_s = 0.0
        self._to_monotonic_s = 0.0

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """List the streams of numbers on the network that say they are EMG.

        Raises:
            MissingExtraError: pylsl is not installed.
        """
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
            for stream in lsl.resolve_byprop("type", "EMG", minimum=0, timeout=min(timeout_s, _LOOK_S))
            if stream.channel_format() != lsl.cf_string
        ]

    def _start(self) -> None:
        """Find the stream and connect to it.

        Raises:
            DeviceUnavailableError: There is none or more than one, or it is not made of numbers.
        """
        o = self._options
        lsl = load_lsl(LslEmg.name)
        found = lsl.resolve_byprop(o.by, o.value, minimum=1, timeout=o.start_s)
        if len(found) != 1:
            said = (
                "no stream"
                if not found
                else f"{len(found)} streams, from {', '.join(f.hostname() for f in found)},"
            )
            raise DeviceUnavailableError(
                f"lsl-emg: {said} with {o.by} {o.value!r} on the network after {o.start_s:g} s",
                "start the sender, and see that no firewall blocks it (UDP 16571, TCP 16572 to 16604)"
                if not found
                else "name one of them by its source_id",
            )
        stream = found[0]
        if stream.channel_format() == lsl.cf_string:
            raise DeviceUnavailableError(
                f"lsl-emg: {o.value!r} is a stream of texts", "choose the amplifier's"
            )
        self._n_channels = int(stream.channel_count())
        self._stated_hz = float(stream.nominal_srate()) or o.rate_hz
        if self._stated_hz is None:
            raise DeviceUnavailableError(
                f"lsl-emg: {o.value!r} states no sample rate", "set rate_hz in its options"
            )
        try:
            self._inlet = lsl.StreamInlet(stream, max_buflen=_BUFFER_S, recover=False)
            self._lost_error = lsl.util.LostError
            self._inlet.open_stream(timeout=o.start_s)
            self._correction_s = float(self._inlet.time_correction(timeout=o.start_s))
        except (RuntimeError, TimeoutError) as error:
            raise DeviceUnavailableError(
                f"lsl-emg: {o.value!r} was found, but did not connect: {error}",
                "see that no firewall blocks TCP 16572 to 16604",
            ) from error
        self._to_monotonic_s = to_monotonic_s(lsl)
        self._last_s = None

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
        taken_s = np.asarray(stamps, np.float64) + self._correction_s
        missing = self._missing(taken_s)
        arrival_ns = min(round((taken_s[-1] + self._to_monotonic_s) * 1e9), time.monotonic_ns())
        return Arrived(samples, missing, arrival_ns)

    def _missing(self, taken_s: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return how many samples the sender's stamps say are missing before each."""
        before = self._last_s if self._last_s is not None else taken_s[0]
        self._last_s = float(taken_s[-1])
        rate_hz = self._stated_hz or 1.0
        steps = np.diff(taken_s, prepend=before)
        lost = np.rint(steps * rate_hz).astype(np.int64) - 1
        return np.where(steps > _GAP_S, np.maximum(lost, 0), 0)

    def _stop(self) -> None:
        if self._inlet is not None:
            self._inlet.close_stream()
        self._inlet = None

    def _rate_hz(self) -> float | None:
        return self._stated_hz

    def _all_channels(self) -> int:
        return self._n_channels

    def _unit(self) -> str:
        return "as sent"

    def _limits(self) -> tuple[float, float] | None:
        return self._options.limits

    def _label(self) -> str:
        return self._options.value.replace("/", "_").replace("\\", "_")
