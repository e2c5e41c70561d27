"""Open and read live EMG sources: check their rate, stamp samples, track health, report silence."""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Mapping
from typing import Annotated, ClassVar, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options
from tega.devices.emg.emg_health import EmgHealth
from tega.devices.emg.stream_evidence import PacketOrder, ValueCheck
from tega.devices.sample_clock import (
    LEAST_RATE_HZ,
    LOST_TOLERANCE,
    RATE_TOLERANCE,
    SampleClock,
    too_slow,
    wrong_rate,
)
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Contradiction, Contradictions, Evidence, refuse
from tega.runtime.lifecycle import Opened

POLL_S = 0.004
"""How often a source is looked at while waiting: one period of a 250 Hz board."""

# Random bytes can look like a packet once in a second; a source that gives less than this share is silent.
_ALIVE_SHARE = 0.05
# Between two looks at the source at most this much counts as its silence: we may have been held up ourselves.
_LOOKED_AWAY_S = 0.25
# Held up for longer than this, more samples came than a port's buffer keeps, and the rate has to be measured afresh.
_HELD_UP_S = 0.4
# A port's buffers are empty after this many looks, or it is not only what has waited that comes.
_MOST_WAITING = 64
# On a machine that is never still for long enough, opening gives up after this long.
_MOST_MEASURING_S = 30.0
# A measurement disturbed by a busy machine evens out with time: it may take this many times as long before a refusal.
_PATIENCE = 5


class LiveEmgOptions(Options, frozen=True, kw_only=True):
    """Settings that all live sources have.

    Attributes:
        channels: Channels to use, counted from 1; none means all.
        measure_s: The true sample rate is measured for so long at most when the source opens; a rate that seems wrong
            is measured longer.
        silence_s: Without a valid sample for this long the source is given up.
        start_s: How long the first valid sample may take.
    """

    channels: tuple[Annotated[int, msgspec.Meta(ge=1, le=64)], ...] = ()
    measure_s: Annotated[float, msgspec.Meta(ge=0.25, le=60)] = 2.0
    silence_s: Annotated[float, msgspec.Meta(ge=0.1, le=60)] = 1.0
    start_s: Annotated[float, msgspec.Meta(ge=0.1, le=60)] = 5.0


class Arrived(NamedTuple):
    """Samples that came in at once, at least one; ``arrival_ns`` is on the monotonic clock.

    Attributes:
        samples: float64 (n, channels), all channels of the device.
        missing: int64 (n,), samples missing before each, by the device's counter; ``None`` where it has none.
    """

    samples: NDArray[np.float64]
    missing: NDArray[np.int64] | None
    arrival_ns: int


class LiveEmg(Opened):
    """A live EMG source; a driver adds the start, the reading of samples, and the stop.

    A driver sets ``_rate_hz``, the stated rate, ``_n_channels``, all channels of the device, and ``limits``
    as soon as it knows them, at the latest in ``_start``. ``health`` is ``None`` before the source was
    opened.

    Attributes:
        usual_channels: Channels to use where none are set; none means all.
        counter_turn: After how many samples the device's own counter repeats; ``None`` where it has none.
        counter_hint: The next step where the device's numbers are no counter.
        free_columns: Whether only the settings define which columns are muscles.
        compared: Evidence in the stream, and what it is compared with (:mod:`tega.runtime.evidence`).
        limits: The converter's limits in the unit of the samples; ``None`` if unknown.
    """

    kind: ClassVar[Kind] = "emg"
    name: ClassVar[str]
    unit: ClassVar[str] = "counts"
    usual_channels: ClassVar[tuple[int, ...]] = ()
    counter_turn: ClassVar[int | None] = None
    counter_hint: ClassVar[str] = "check cable and power; end other programs that read this device"
    free_columns: ClassVar[bool] = False
    compared: ClassVar[Mapping[Evidence, str]] = {}

    def __init__(self, options: LiveEmgOptions, label: str) -> None:
        self._options, self._label = options, label
        self._rate_hz: float | None = None
        self._n_channels = 0
        self.limits: tuple[float, float] | None = None
        self._open = False
        self._lost: DeviceUnavailableError | None = None
        self._chunks: deque[EmgChunk] = deque()
        self._clock: SampleClock | None = None
        self.health: EmgHealth | None = None
        self._begun = False
        self._next_index = 0
        self._n_fresh = 0
        self._order = PacketOrder(self.counter_turn or 1)
        self._contradictions = Contradictions()
        self._values: ValueCheck | None = None
        self._silent_s = 0.0
        self._looked_at_s = 0.0
        self._checked_at_s = 0.0

    def _start(self) -> None:
        """Connect and switch the stream on."""
        raise NotImplementedError

    def _arrived(self) -> Arrived | None:
        """Return the samples that have arrived, without waiting."""
        raise NotImplementedError

    def _stop(self) -> None:
        """Switch the stream off and disconnect; called in whatever state things are."""
        raise NotImplementedError

    def _undecided(self) -> bool:
        """Whether opening has to wait for more samples before the stream's evidence can be judged."""
        return False

    def _instead(self) -> str:
        """Describe the data that came instead of samples."""
        return ""

    def _own_notes(self) -> tuple[str, ...]:
        """Return the notes that a reader of the results must know."""
        return ()

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and channels, with notes on the signal faults so far."""
        # Each looked at once: the thread that reads may put another in its place meanwhile.
        clock, order, health = self._clock, self._order, self.health
        notes = self._own_notes()
        if clock is not None and (text := self._rate_words()):
            notes += (text,)
        if order.n_repeated:
            notes += (f"{order.n_repeated} packets came twice; used once",)
        if order.n_damaged:
            notes += (f"{order.n_damaged} packets had a number that cannot be true; not used",)
        notes += tuple(str(one) for one in self._contradictions.seen if one.evidence != "rate")
        if health is not None:
            notes += health.words()
        return DeviceInfo(
            driver=self.name,
            kind="emg",
            label=self._label,
            live=True,
            rate_hz=self._rate_hz,
            channels=tuple(f"ch{c}" for c in self._columns()),
            unit=self.unit,
            notes=notes,
        )

    @property
    def ended(self) -> bool:
        """Never: a live source that goes away raises."""
        return False

    @property
    def measured_hz(self) -> float | None:
        """True samples per second over the last ten seconds; ``None`` before the source was opened."""
        return None if self._clock is None else self._clock.measured_hz

    @property
    def faults(self) -> tuple[str, ...]:
        """Contradictions of the stream, then faults of the newest second of the signal, one sentence each."""
        health = self.health
        return (*map(str, self._contradictions.now), *(() if health is None else health.now))

    @property
    def contradictions(self) -> tuple[Contradiction, ...]:
        """Differences between the stream's own evidence and the settings that leave the samples usable."""
        return self._contradictions.now

    def open(self) -> None:
        """Connect, start the stream and measure its true rate; the samples of that time are not delivered.

        ``DeviceUnavailableError`` also means that this machine is too busy to measure the rate.
        ``SampleRateError``: too slow for the filter, or not the stated rate. ``StreamContradictionError``:
        the stream's own evidence shows that its samples cannot be used.
        """
        self.close()
        self._open, self._lost = True, None
        self._order = PacketOrder(self.counter_turn or 1, hint=self.counter_hint)
        self._contradictions = Contradictions()
        # Any way out of the program that runs Python code switches the stream off, SIGTERM too.
        closes_on_exit(self.close)
        try:
            self._start()
            self._prove()
        except BaseException:
            self.close()
            raise
        self._begun = False

    def close(self) -> None:
        """Switch the stream off and disconnect."""
        if not self._open:
            return
        self._open = False
        release(self.close)
        self._chunks.clear()
        self._stop()

    def read(self, timeout_s: float) -> EmgChunk | None:
        """Return the next samples without a gap between them; ``None`` when none came within ``timeout_s``.

        Samples from before the first call are discarded: a port keeps at most half a second, and such losses
        are not counted. ``DeviceUnavailableError`` also means that the source has been silent for too long.
        Raises ``SampleRateError`` and ``StreamContradictionError`` as :meth:`open` does.
        """
        if not self._open:
            raise DeviceUnavailableError(f"{self.name} {self._label!r} is not open", "open it first")
        if self._lost is not None:
            raise self._lost
        deadline_s = time.monotonic() + timeout_s
        try:
            if not self._begun:
                self._begin()
            while not self._chunks:
                self._collect()
                left_s = deadline_s - time.monotonic()
                if self._chunks or left_s <= 0:
                    break
                time.sleep(min(POLL_S, left_s))
        except DeviceUnavailableError as error:
            self._lost = error
            raise
        return self._chunks.popleft() if self._chunks else None

    def _begin(self) -> None:
        """Discard the data that arrived since the source was opened."""
        for _ in range(_MOST_WAITING):
            if self._arrived() is None:
                break
        self._chunks.clear()
        self._begun, self._next_index, self._n_fresh = True, 0, 0
        self._looked_at_s = time.monotonic()
        if self._clock is not None:
            self._clock.restart()
        names, rate_hz = tuple(f"ch{c}" for c in self._columns()), self._rate_hz or 0.0
        self.health = EmgHealth(rate_hz, names, limits=self.limits)
        self._values = ValueCheck(rate_hz, names, limits=self.limits, free_columns=self.free_columns)

    def _collect(self) -> None:
        """Queue the arrived samples, split at missing samples."""
        arrived, clock, now_s = self._arrived(), self._clock, time.monotonic()
        if arrived is not None and arrived.missing is not None and self.counter_turn is not None:
            room = 2**31 if clock is None else clock.room(len(arrived.samples), arrived.arrival_ns)
            arrived = Arrived(*self._order.once(arrived.samples, arrived.missing, room), arrived.arrival_ns)
            if (contradiction := self._order.contradiction) is not None:
                refuse(self.name, self._label, contradiction)
        self._n_fresh += 0 if arrived is None else len(arrived.samples)
        away_s, self._looked_at_s = now_s - self._looked_at_s, now_s
        self._silent_s += min(away_s, _LOOKED_AWAY_S)
        if clock is not None and away_s > _HELD_UP_S:
            clock.forget_rate()
        if self._n_fresh >= _ALIVE_SHARE * self._options.silence_s * (self._rate_hz or 0.0):
            self._n_fresh, self._silent_s = 0, 0.0
        elif self._silent_s > self._options.silence_s:
            raise self._silent(self._options.silence_s)
        if arrived is None or clock is None or not len(arrived.samples):
            return
        samples, missing = arrived.samples, arrived.missing
        n_missing = 0 if missing is None else int(missing.sum())
        stamp = clock.take(len(samples), arrived.arrival_ns, n_missing)
        columns = [c - 1 for c in self._columns()]
        cuts = [0, *([] if missing is None else (missing[1:].nonzero()[0] + 1).tolist()), len(samples)]
        self._next_index += stamp.n_lost
        for first, last in itertools.pairwise(cuts):
            self._next_index += 0 if missing is None else int(missing[first])
            chunk = EmgChunk(stamp.t_ns, self._next_index, samples[first:last][:, columns])
            self._next_index += last - first
            self._chunks.append(chunk)
            if self.health is not None and self._values is not None:
                self.health.take(chunk)
                self._values.take(chunk.samples, self._contradictions)
        if self.health is not None and now_s - self._checked_at_s > 1.0:
            self._checked_at_s = now_s
            self._check_running(clock)

    def _prove(self) -> None:
        rate_hz = self._rate_hz
        if rate_hz is None or rate_hz < LEAST_RATE_HZ:
            raise too_slow(f"{self.name}: {self._label}", rate_hz, "is said to send")
        wanted, there = self._columns(), self._n_channels
        if max(wanted) > there or len(set(wanted)) < len(wanted):
            raise DeviceUnavailableError(
                f"{self.name}: {self._label} has {there} channels, asked for {list(wanted)}",
                f"set channels to different numbers from 1 to {there}",
            )
        self._clock, self.health = SampleClock(rate_hz, counter_turn=self.counter_turn), None
        self._measure(self._clock, rate_hz)

    def _measure(self, clock: SampleClock, rate_hz: float) -> None:
        """Wait for the first sample, then measure until the rate is proven, or certainly another.

        It is proven once no delay of a USB adapter can hide another rate. A source with larger delays is
        judged by its measured rate after ``measure_s``.
        """
        wait_s, patience_s = self._options.start_s, _PATIENCE * self._options.measure_s
        waited_s = measured_s = 0.0
        most_s, spent_s = wait_s + max(_MOST_MEASURING_S, 2 * patience_s), 0.0
        while True:
            before_s, self._silent_s = time.monotonic(), 0.0
            time.sleep(POLL_S)
            self._collect()
            looked_s = time.monotonic() - before_s
            spent_s += min(looked_s, 1.0)  # being stopped for a while is one disturbance, however long
            if looked_s > _LOOKED_AWAY_S:
                # The machine was busy elsewhere: begin again.
                clock.forget_rate()
                measured_s = 0.0
            elif self._chunks or measured_s > 0:
                measured_s += looked_s
            else:
                waited_s += looked_s
            self._chunks.clear()
            if waited_s > wait_s:
                raise self._silent(wait_s)
            if measured_s > 0 and clock.proves(rate_hz, RATE_TOLERANCE) and not self._undecided():
                return
            if measured_s > self._options.measure_s and not (self._undecided() and measured_s <= patience_s):
                measured_hz = clock.measured_hz or 0.0
                if abs(measured_hz / rate_hz - 1) <= RATE_TOLERANCE:
                    return
                if measured_s > patience_s:
                    raise wrong_rate(f"{self.name}: {self._label}", measured_hz, rate_hz)
            if spent_s > most_s:
                raise DeviceUnavailableError(
                    f"{self.name}: this machine was too busy for {most_s:g} s to measure the sample rate of "
                    f"{self._label}",
                    "end what else runs on it",
                )

    def _check_running(self, clock: SampleClock) -> None:
        rate_hz, measured_hz = self._rate_hz, clock.measured_hz
        if rate_hz is None or measured_hz is None or clock.measured_s < 5.0:
            return
        if measured_hz < LEAST_RATE_HZ or abs(measured_hz / rate_hz - 1) > LOST_TOLERANCE:
            raise wrong_rate(f"{self.name}: {self._label}", measured_hz, rate_hz)
        words = self._rate_words()
        hint = "set the board, or rate_hz and a new calibration, to the measured rate"
        self._contradictions.note("rate", Contradiction("rate", words, hint) if words else None)

    def _rate_words(self) -> str:
        rate_hz, measured_hz = self._rate_hz, self.measured_hz
        if rate_hz is None or measured_hz is None or abs(measured_hz / rate_hz - 1) <= RATE_TOLERANCE:
            return ""
        return f"{measured_hz:.1f} samples/s came where {rate_hz:g} were expected"

    def _silent(self, after_s: float) -> DeviceUnavailableError:
        instead = self._instead()
        return DeviceUnavailableError(
            f"{self.name}: {self._label} sent no valid sample for {after_s:g} s"
            + (f"; {instead}" if instead else ""),
            "check power, cable and baud rate" if instead else "check power and cable",
        )

    def _columns(self) -> tuple[int, ...]:
        return self._options.channels or self.usual_channels or tuple(range(1, self._n_channels + 1))
