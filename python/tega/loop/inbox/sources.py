"""Read EMG samples, turn them into levels for the hand, and count a source's items."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk, EmgSource, TactileFrame
from tega.emg.votes import ChannelVotes
from tega.errors import DeviceUnavailableError, InvalidValueError, ShapeError, TegaError
from tega.hand import nearest_level
from tega.loop.emg_adaptation import ChannelAdaptation
from tega.loop.inbox.reader import READ_TIMEOUT_S, Given, opened_again
from tega.records import EmgSamples, Intent, Picture
from tega.stages.base import Decoder

# Of missing EMG samples at most this much is given to the filters, which start afresh after a tenth of a second.
MOST_GAP_S = 1.0

_ROUNDING_NS = 1000

# The level before a fault is looked for among so many blocks; a fault is seen after two thirds of a second at most.
_KEPT_BLOCKS = 256


def picture_of(
    finger: str,
    frame: TactileFrame,
    *,
    received_ns: int | None = None,
    start_ns: int = 0,
    loaded: bool = False,
    rezeroed: bool = False,
) -> Picture:
    """Return the record of a picture; ``received_ns`` is monotonic, as ``start_ns``, ``None`` for one out of a file."""
    t_ns = frame.t_ns if received_ns is None else frame.t_ns - start_ns
    return Picture(
        finger=finger,
        image=frame.image,
        t_ns=t_ns,
        received_ns=t_ns if received_ns is None else received_ns - start_ns,
        seq=frame.seq,
        name=frame.name,
        loaded=loaded,
        rezeroed=rezeroed,
    )


def samples_of(chunk: EmgChunk, *, live: bool, start_ns: int) -> EmgSamples:
    """Return the record of EMG samples that were read just now; those out of a file were received long ago."""
    t_ns = chunk.t_ns - start_ns if live else chunk.t_ns
    received_ns = time.monotonic_ns() - start_ns if live else t_ns
    return EmgSamples(
        t_ns=t_ns,
        received_ns=received_ns,
        first_index=chunk.first_index,
        n_channels=chunk.samples.shape[1],
        samples=chunk.samples.ravel(),
    )


def frame_of(picture: Picture) -> TactileFrame:
    """Return the frame that a picture was read as."""
    return TactileFrame(picture.t_ns, picture.seq, picture.image, picture.name)


def chunk_of(given: EmgSamples) -> EmgChunk:
    """Return the chunk that EMG samples were read as, (n, channels)."""
    return EmgChunk(given.t_ns, given.first_index, given.samples.reshape(-1, given.n_channels))


class SourceReport(msgspec.Struct, kw_only=True):
    """Counts of a source's items; frames measured are ``n_items + n_stuck - n_identical``.

    Attributes:
        n_items: Frames or samples used.
        n_dropped: Items of a live source that could not be used, or came faster than they were taken.
        n_missing: Items that never came, by the gaps in their numbers.
        n_duplicate: Frames delivered again under the number they had before; neither measured nor used.
        n_identical: Frames with a number of their own and exactly the pixels of the one before; not measured.
        n_stuck: Frames of a live source that were the third or later repeat in a row; not used.
        n_unfit: Frames of a live source that were dark, torn, or between such ones: neither measured nor used.
        n_rezero_refused: New baselines that were refused, because another finger bore a load or the picture was dark.
        lost: Reason for the current loss of the source; ``""`` while it is there.
        end_ns: Time at which the source ended; ``None`` before.
        faults: Channels of EMG, or faults of a camera, without a vote now, with the reason.
    """

    n_items: int = 0
    n_dropped: int = 0
    n_missing: int = 0
    n_duplicate: int = 0
    n_identical: int = 0
    n_stuck: int = 0
    n_unfit: int = 0
    n_rezeroed: int = 0
    n_rezero_refused: int = 0
    lost: str = ""
    n_lost: int = 0
    last_lost: str = ""
    end_ns: int | None = None
    faults: tuple[str, ...] = ()

    def drop(self) -> None:
        """Count an item that was not used."""
        self.n_dropped += 1

    def lose(self, why: str) -> None:
        """Note that the source went away."""
        self.n_lost += 1
        self.lost = self.last_lost = why


class BlockMeter:
    """Turns EMG samples into levels as they come; ``end_ns`` is the time of the newest sample.

    ``live`` is whether these come from a device that runs on its own clock; the time ``start_ns`` at the session's
    start is subtracted from its stamps. ``adaptation`` adapts the decoder's input.
    """

    def __init__(
        self,
        decoder: Decoder,
        report: SourceReport,
        *,
        maxima: EmgMaxima,
        live: bool,
        start_ns: int = 0,
        adaptation: ChannelAdaptation | None = None,
    ) -> None:
        self._decoder, self._adaptation, self.report = decoder, adaptation, report
        self._votes = ChannelVotes(maxima.rate_hz, maxima.tau, maxima.kind, maxima.channels, maxima.maxima)
        # The faults that the report lists.
        self._reported = self._votes.faults
        # Blocks that had a vote, with the number of samples at their end.
        self._sound: deque[tuple[int, Intent]] = deque(maxlen=_KEPT_BLOCKS)
        self._names, self._rate_hz = maxima.channels, maxima.rate_hz
        self._live = live
        self._start_ns = start_ns if live else 0
        self._n_samples = self._next_index = 0
        self.end_ns = 0

    def restart(self) -> None:
        """Continue with a source that was away: the missed samples are a gap, whatever number it counts from."""
        self._next_index = -round(MOST_GAP_S * self._rate_hz)

    def take(self, chunk: EmgChunk) -> list[Intent]:
        """Take the next samples, (n, channels), in the source's unit; return the intents of complete blocks.

        Samples missing before these, by their numbers, take up time too. Another number of channels than the
        maxima's is ``ShapeError``.
        """
        samples, report, votes, adaptation = chunk.samples, self.report, self._votes, self._adaptation
        n_missing = max(0, chunk.first_index - self._next_index)
        if n_missing:
            n_told = min(n_missing, round(MOST_GAP_S * self._rate_hz))
            samples = np.concatenate([np.full((n_told, *samples.shape[1:]), np.nan), samples])
        end_ns = chunk.t_ns - self._start_ns
        times_ns = self._times_ns(len(samples), end_ns, chunk.first_index + len(chunk.samples))
        intents, at = list[Intent](), 0
        while at < len(samples):
            part = slice(at, at + votes.room)
            voting = votes.take(samples[part])
            at += len(voting)
            self._n_samples += len(voting)
            given = voting if adaptation is None else adaptation.take(voting)
            made = [self._believed(intent) for intent in self._decoder.decode(given, times_ns[part])]
            if adaptation is not None:
                adaptation.decoded(made, int(times_ns[at - 1]))
            intents += made
        report.n_items += len(chunk.samples)
        report.n_missing += n_missing
        self._next_index = chunk.first_index + len(chunk.samples)
        self.end_ns = end_ns
        if votes.faults is not self._reported:
            self._reported = votes.faults
            report.faults = tuple(f"{name}: {why}" for name, why in self._reported.items())
        return intents

    def _times_ns(self, n: int, end_ns: int, n_whole: int) -> NDArray[np.int64]:
        """Return the times of the next samples: arrival for a live source, completion for a recording.

        The last of them has the stated time ``end_ns`` and, from 1 with lost ones, the number ``n_whole``.
        """
        if self._live:
            return np.full(n, end_ns, np.int64)
        numbers = np.arange(n_whole - n + 1, n_whole + 1)
        times_ns = np.rint(numbers * 1_000_000_000 / self._rate_hz).astype(np.int64)
        # A file with times of its own is not on the even course of its rate; a microsecond is rounding.
        late_ns = end_ns - int(times_ns[-1]) if n else 0
        return times_ns + late_ns if abs(late_ns) > _ROUNDING_NS else times_ns

    def _believed(self, intent: Intent) -> Intent:
        """Return a decoder's intent without the channels at fault; with none left, as before the fault began."""
        intent, faults = _checked(intent, len(self._names)), self._votes.faults
        if faults:
            levels = zip(self._names, intent.channels, strict=True)
            intent = replace(intent, channels=tuple(0 if name in faults else level for name, level in levels))
        if any(intent.channels) and self._sound and self._votes.still:
            # The next block shows whether this is a fault; until then its low level is not passed on.
            last = self._sound[-1][1]
            intent = replace(intent, level=last.level, closure=last.closure)
        elif any(intent.channels):
            self._sound.append((self._n_samples, intent))
        elif (began := self._votes.began) is not None:
            # What was made of samples before the fault was seen must not be what the hand holds.
            before = next((sound for n, sound in reversed(self._sound) if n <= began), intent)
            intent = replace(intent, level=before.level, closure=before.closure)
        return intent


def _checked(intent: Intent, n_channels: int) -> Intent:
    """Return a decoder's intent, checked: the decoder may be anybody's. A closure sets the level to the nearest."""
    level, closure = intent.level, intent.closure
    if closure is not None:
        if not 0.0 <= closure <= 1.0:
            raise InvalidValueError(f"the decoder asks for a closure of {closure!r}: 0 to 1 is possible")
        level = nearest_level(closure)
    if level not in {1, 2, 3, 4, 5}:
        raise InvalidValueError(f"the decoder asks for level {level!r}: 1 to 5 are possible")
    if len(intent.channels) != n_channels or not {0, 1, 2, 3, 4, 5}.issuperset(intent.channels):
        raise InvalidValueError(
            f"the decoder gives {intent.channels!r} for {n_channels} channels", "give a level 0 to 5 for each"
        )
    return replace(intent, level=level)


def read_measured(
    source: Any,
    report: SourceReport,
    measure: Callable[[Any, int], Given],
    restart: Callable[[], None],
    *,
    bad: type[TegaError],
    stopped: Callable[[], bool],
) -> Iterator[Given]:
    """Yield what ``measure`` returns for each item of an open source and the monotonic time of its reception.

    In a recording an error is raised. An item of a live source with an error of ``bad`` is dropped and counted. If the
    source goes away it is opened again, once a second until that works or ``stopped`` returns true; ``restart`` is
    called then.
    """
    live = source.info.live
    while not (stopped() or source.ended):
        try:
            item = source.read(READ_TIMEOUT_S)
            if item is None:
                continue
            found = measure(item, time.monotonic_ns())
        except DeviceUnavailableError as error:
            if not live:
                raise
            report.lose(error.message)
            if not opened_again(source, stopped):
                return
            report.lost = ""
            restart()
        except bad:
            if not live:
                raise
            report.drop()
        else:
            yield found


def grasp_blocks(
    source: EmgSource,
    meter: BlockMeter,
    *,
    stopped: Callable[[], bool] = lambda: False,
    stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None,
    observe: Callable[[EmgChunk], None] = lambda _chunk: None,
) -> Generator[Intent, None, int]:
    """Turn an open source's samples into levels, one per block; returns when it ended, nanoseconds.

    A block of a recording is stamped with the time at which its last sample was complete, n/rate, one of a live source
    with the arrival of the chunk that completed it. ``stamp`` is called with each block's time and the monotonic time
    at which its last samples were received; ``observe`` with the samples that were read, before they are decoded.
    """

    def measure(chunk: EmgChunk, received_ns: int) -> tuple[list[Intent], int]:
        observe(chunk)
        return meter.take(chunk), received_ns

    report = meter.report
    for intents, received_ns in read_measured(
        source, report, measure, meter.restart, bad=ShapeError, stopped=stopped
    ):
        for intent in intents:
            stamp(intent.t_ns, received_ns)
            yield intent
    report.end_ns = meter.end_ns if source.ended else None
    return meter.end_ns
