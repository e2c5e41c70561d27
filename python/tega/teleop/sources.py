"""From device to measurement: the generators the streams run on."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from tega.devices.base import EmgSource, TactileSource
from tega.errors import DeviceUnavailableError, RecordingError, ShapeError, TegaError
from tega.tactile import ContactMetrics, read_contact
from tega.teleop.repeats import STUCK_FRAMES, LastFrame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.emg import GraspIntent

__all__ = ["Block", "Contact", "SourceReport", "grasp_blocks", "measured_contacts"]

# How long a live source may keep its thread from noticing that the run is over.
READ_TIMEOUT_S = 0.1

# Of missing EMG samples at most this much is told to the filters, which start afresh after a tenth of a second.
MOST_GAP_S = 1.0

# Rest after a live source gave the frame it had given before: one that does not wait for its next frame would
# otherwise keep a core busy with asking.
SEEN_REST_S = 0.001

Contact = tuple[int, ContactMetrics]
"""Time in nanoseconds, what was measured."""

Block = tuple[int, tuple[int, ...], int]
"""Time in nanoseconds, the level of each channel, the fused level."""


class SourceReport(msgspec.Struct, kw_only=True):
    """What became of a source's items.

    Frames measured are ``n_items + n_stuck - n_identical``.

    Attributes:
        n_items: Frames or samples used.
        n_dropped: Items of a live source that could not be used, or came faster than they were taken.
        n_missing: Items that never came, by the gaps in their numbers.
        n_duplicate: Frames delivered again under the number they had before; neither measured nor used.
        n_identical: Frames with a number of their own and exactly the pixels of the one before; not measured.
        n_stuck: Of those, from a live source, the third and later in a row: not used either.
        lost: Why the source went away, if it did.
        end_ns: When the source ended, once it has.
    """

    n_items: int = 0
    n_dropped: int = 0
    n_missing: int = 0
    n_duplicate: int = 0
    n_identical: int = 0
    n_stuck: int = 0
    lost: str = ""
    end_ns: int | None = None

    def drop(self) -> None:
        """Count an item that was not used."""
        self.n_dropped += 1


def measured_contacts(
    source: TactileSource,
    baseline: NDArray[np.uint8],
    reading: Literal["paper", "live"],
    report: SourceReport,
    *,
    start_ns: int = 0,
    stopped: Callable[[], bool] = lambda: False,
) -> Generator[Contact, None, int]:
    """Measure the frames of a source.

    In a recording a bad frame is an error. Of a live source it is dropped and counted, and when the source goes
    away the stream ends: after 100 ms the finger falls silent.

    A frame that the source delivers again, by its number, is passed over. One with exactly the pixels of the frame
    before it is not measured again. Of a live source the third and later of such frames in a row are not passed
    on: the sensor is stuck, and its finger falls silent like any other without fresh frames until pixels change.

    Args:
        source: An open source.
        baseline: Its untouched picture, uint8 (H, W, 3).
        reading: The preset's reading.
        report: Counted up along the way.
        start_ns: The clock's time at the start of the session; subtracted from a live source's stamps.
        stopped: Tells when to give up.

    Yields:
        Time and metrics of each frame.

    Returns:
        When the source ended, in nanoseconds.

    Raises:
        RecordingError: A recorded frame is unreadable or not of the baseline's size.
    """
    live, end_ns, next_seq = source.info.live, 0, 0
    last, last_seq = LastFrame(), None
    while not (stopped() or source.ended):
        try:
            frame = source.read(READ_TIMEOUT_S)
            if frame is None:
                continue
            if frame.seq == last_seq:
                report.n_duplicate += 1
                if live:
                    time.sleep(SEEN_REST_S)
                continue
            last_seq = frame.seq
            metrics = last.repeat(frame.image)
            if metrics is None:
                metrics = _measure(frame.image, baseline, reading, frame.name)
                last.keep(frame.image, metrics)
            else:
                report.n_identical += 1
        except DeviceUnavailableError as error:
            if not live:
                raise
            report.lost = error.message
            break
        except TegaError:
            if not live:
                raise
            report.drop()
            continue
        report.n_missing += max(0, frame.seq - next_seq)
        next_seq = frame.seq + 1
        end_ns = t_ns = frame.t_ns - start_ns if live else frame.t_ns
        if live and last.n_equal >= STUCK_FRAMES:
            report.n_stuck += 1
            continue
        report.n_items += 1
        yield t_ns, metrics
    rate_hz = source.info.rate_hz
    if not live and rate_hz:
        end_ns = round(next_seq * 1_000_000_000 / rate_hz)
    report.end_ns = end_ns
    return end_ns


def _measure(
    image: NDArray[np.uint8], baseline: NDArray[np.uint8], reading: Literal["paper", "live"], name: str
) -> ContactMetrics:
    if image.shape != baseline.shape:
        raise RecordingError(
            f"{name}: {_size(image)} pixels, its baseline has {_size(baseline)}",
            "give the baseline taken with the same sensor and mode",
        )
    return read_contact(image, baseline, reading=reading)


def _size(image: NDArray[np.uint8]) -> str:
    return "×".join(str(n) for n in (image.shape[1], image.shape[0], *image.shape[2:]))


def grasp_blocks(
    source: EmgSource,
    intent: GraspIntent,
    report: SourceReport,
    *,
    rate_hz: float,
    tau: int,
    start_ns: int = 0,
    stopped: Callable[[], bool] = lambda: False,
) -> Generator[Block, None, int]:
    """Turn the samples of a source into levels, one per block.

    A block of a recording is stamped with the time at which its last sample was complete, n/rate, however the
    samples came in chunks. A block of a live source is stamped with the arrival of the chunk that completed it.

    Args:
        source: An open source.
        intent: Samples to levels.
        report: Counted up along the way.
        rate_hz: Samples per second.
        tau: Samples per block.
        start_ns: The clock's time at the start of the session; subtracted from a live source's stamps.
        stopped: Tells when to give up.

    Yields:
        Time, level of each channel and fused level of each block.

    Returns:
        When the source ended, in nanoseconds.
    """
    live, end_ns, n_blocks, next_index = source.info.live, 0, 0, 0
    while not (stopped() or source.ended):
        try:
            chunk = source.read(READ_TIMEOUT_S)
            if chunk is None:
                continue
            n_missing = max(0, chunk.first_index - next_index)
            samples = chunk.samples
            if n_missing:
                gap = np.full((min(n_missing, round(MOST_GAP_S * rate_hz)), *samples.shape[1:]), np.nan)
                samples = np.concatenate([gap, samples])
            fused = intent.process(samples)
        except DeviceUnavailableError as error:
            if not live:
                raise
            report.lost = error.message
            break
        except ShapeError:
            if not live:
                raise
            report.drop()
            continue
        report.n_items += len(chunk.samples)
        report.n_missing += n_missing
        next_index = chunk.first_index + len(chunk.samples)
        end_ns = chunk.t_ns - start_ns if live else chunk.t_ns
        for channels, level in zip(intent.levels.tolist(), fused.tolist(), strict=True):
            n_blocks += 1
            t_ns = end_ns if live else round(n_blocks * tau * 1_000_000_000 / rate_hz)
            yield t_ns, tuple(channels), level
    report.end_ns = end_ns
    return end_ns
