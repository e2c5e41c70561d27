"""Read a fingertip's pictures and measure each one once, as they arrive."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import Final, NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tega.devices.base import TactileFrame, TactileSource
from tega.errors import RecordingError, TegaError
from tega.loop.inbox.picture_votes import (
    STUCK_FRAMES,
    CameraVote,
    KeptPicture,
    is_repeat,
    kept_picture,
    picture_fault,
    untouched_lines,
)
from tega.loop.inbox.sources import SourceReport, read_measured
from tega.records import Contact
from tega.stages.base import Metric

# Rest after a live source gave the frame it had given before: one that does not wait for its next frame would
# otherwise keep a core busy with asking.
SEEN_REST_S = 0.001


class FrameMeter:
    """Measures each frame of one finger once, as they arrive.

    ``baseline`` is uint8 (H, W, 3). ``live`` is whether the frames come from a sensor that runs on its own clock; the
    time ``start_ns`` at the session's start is subtracted from its stamps. ``seq`` is the newest frame's number.
    """

    def __init__(
        self,
        baseline: NDArray[np.uint8],
        metric: Metric,
        report: SourceReport,
        *,
        live: bool,
        start_ns: int = 0,
    ) -> None:
        self._shape = baseline.shape
        self.metric, self.report, self.live = metric, report, live
        self.start_ns = start_ns if live else 0
        self._last: KeptPicture | None = None
        self._n_equal = 0
        self._vote, self._untouched = CameraVote(), untouched_lines(baseline)
        self._lines: list[bytes] = []
        self.seq: int | None = None
        self.next_seq = 0

    def take(self, frame: TactileFrame) -> Contact | None:
        """Measure a frame; another size than the baseline's is ``RecordingError``.

        ``None`` for a frame that came again under its number, or of a live sensor without a vote.
        """
        report, last, t_ns = self.report, self._last, frame.t_ns - self.start_ns
        contact, may_vote = None, True
        if frame.seq == self.seq:
            report.n_duplicate += 1
            return None
        self.seq = frame.seq
        if last is not None and is_repeat(frame.image, last):
            contact = _stamped(last.contact, t_ns)
            self._n_equal += 1
            report.n_identical += 1
        else:
            self._check_size(frame)
            # One that has no vote is not measured either: no metric learns from it.
            if self.live:
                fault, self._lines = picture_fault(frame.image, self._untouched, self._lines)
                may_vote = self._vote.take(fault, frame.t_ns)
            if may_vote:
                contact = _stamped(self.metric.update(frame.image, t_ns), t_ns)
                self._last, self._n_equal = kept_picture(frame.image, contact), 1
        if self.live and self.next_seq == 0:
            # Pictures of a camera that came while it warmed up, or before anybody read, are not missing in the run.
            self.next_seq = frame.seq
        report.n_missing += max(0, frame.seq - self.next_seq)
        self.next_seq = frame.seq + 1
        if self.live and self._n_equal >= STUCK_FRAMES:
            report.n_stuck += 1
            self._vote.frozen()
        report.n_unfit += not may_vote
        report.faults = (self._vote.fault,) if self._vote.fault else ()
        if contact is None or self._vote.fault:
            return None
        report.n_items += 1
        return contact

    def take_sums(self, seq: int, t_ns: int, sums: NDArray[np.int16]) -> Contact:
        """Measure a picture that is not painted, by its sums; it and ``seq`` are taken to differ from the last."""
        report = self.report
        self.seq = seq
        report.n_missing += max(0, seq - self.next_seq)
        self.next_seq = seq + 1
        report.n_items += 1
        return _stamped(self.metric.update_sums(sums, t_ns), t_ns)

    def restart(self) -> None:
        """Forget the numbers of a source that was opened again: it counts from wherever it likes."""
        self.seq, self.next_seq, self._last, self._n_equal = None, 0, None, 0

    def _check_size(self, frame: TactileFrame) -> None:
        if frame.image.shape != self._shape:
            raise RecordingError(
                f"{frame.name}: {_size(frame.image.shape)} pixels, its baseline has {_size(self._shape)}",
                "give the baseline taken with the same sensor and mode",
            )


class FrameWatch(NamedTuple):
    """Functions that follow a finger's frames, called in the thread that measures them.

    ``stamp`` and ``notify`` are called for measured frames, ``prepare`` before and ``observe`` with every frame; times
    are those of reception on the monotonic clock.
    """

    stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None
    prepare: Callable[[TactileFrame], None] = lambda _frame: None
    observe: Callable[[TactileFrame, int], None] = lambda _frame, _received_ns: None
    notify: Callable[[TactileFrame, Contact], None] = lambda _frame, _contact: None


UNWATCHED: Final = FrameWatch()


def fed_contacts(
    meter: FrameMeter,
    take: Callable[[Contact], None],
    fail: Callable[[BaseException], None],
    watch: FrameWatch = UNWATCHED,
) -> Callable[[TactileFrame], None]:
    """Return the function that a sensor's thread calls with each picture; a bad one is dropped and counted.

    ``fail`` is called with an unexpected exception; the thread continues. ``watch.observe`` is called after the
    contact was passed to ``take``, so that recording delays nothing.
    """

    def measure(frame: TactileFrame) -> None:
        received_ns = time.monotonic_ns()
        try:
            try:
                watch.prepare(frame)
                if (contact := meter.take(frame)) is not None:
                    watch.stamp(contact.t_ns, received_ns)
                    take(contact)
                    watch.notify(frame, contact)
            finally:
                watch.observe(frame, received_ns)
        except TegaError:
            meter.report.drop()
        except BaseException as error:  # a panic of native code, too; the loop raises it
            fail(error)

    return measure


def keeps_up(metric: Metric, baseline: NDArray[np.uint8], *, rate_hz: float | None) -> bool:
    """Return whether a metric takes less than half of the frame period; it is run on the baseline for this."""
    if not rate_hz:
        return False
    took_s = []
    for k in range(3):
        begin_s = time.perf_counter()
        metric.update(baseline, k * round(1e9 / rate_hz))
        took_s.append(time.perf_counter() - begin_s)
    return min(took_s) < 0.5 / rate_hz


def measured_contacts(
    source: TactileSource,
    meter: FrameMeter,
    watch: FrameWatch = UNWATCHED,
    *,
    stopped: Callable[[], bool] = lambda: False,
) -> Generator[Contact, None, int]:
    """Measure the frames of an open source; returns the time at which it ended, nanoseconds.

    Errors and losses are those of :func:`read_measured`. Frames that the source delivers again are passed over; of a
    live source so are the third and later in a row with the same pixels, as of a stuck sensor. ``watch.observe`` is
    called before the measurement.
    """

    def measure(frame: TactileFrame, received_ns: int) -> tuple[TactileFrame, int, Contact | None]:
        watch.prepare(frame)
        watch.observe(frame, received_ns)
        if meter.live and frame.seq == meter.seq:
            time.sleep(SEEN_REST_S)
        return frame, received_ns, meter.take(frame)

    report, end_ns = meter.report, 0
    for frame, received_ns, contact in read_measured(
        source, report, measure, meter.restart, bad=TegaError, stopped=stopped
    ):
        end_ns = frame.t_ns - meter.start_ns
        if contact is not None:
            watch.stamp(contact.t_ns, received_ns)
            watch.notify(frame, contact)
            yield contact
    rate_hz = source.info.rate_hz
    if not meter.live and rate_hz:
        end_ns = round(meter.next_seq * 1_000_000_000 / rate_hz)
    report.end_ns = end_ns if source.ended else None
    return end_ns


def _stamped(contact: Contact, t_ns: int) -> Contact:
    """Return a contact with the time of the picture that shows it, each of its values in the field of its name."""
    if contact.more:
        contact = contact.current()
    return contact if contact.t_ns == t_ns else replace(contact, t_ns=t_ns)


def _size(shape: tuple[int, ...]) -> str:
    return "×".join(str(n) for n in (shape[1], shape[0], *shape[2:]))
