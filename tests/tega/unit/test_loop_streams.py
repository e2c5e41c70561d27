"""What a loop reads from: recordings, live sensors and links, on clocks that are moved or keep time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from reference.recordings import baseline
from reference.scripted import MS, STARTED_NS, ScriptedCamera, live_frame
from tega.config.calibration import EmgMaxima
from tega.config.choose import preset_metric
from tega.devices.base import DeviceInfo, EmgChunk
from tega.errors import DeviceUnavailableError, RecordingError
from tega.loop.inbox.frames import FrameMeter, measured_contacts
from tega.loop.inbox.reader import ReadAhead, Reader
from tega.loop.inbox.sources import BlockMeter, SourceReport, grasp_blocks
from tega.loop.inbox.stream import LiveStream, PulledStream
from tega.records import Intent
from tega.stages.base import MuscleSetup
from tega.stages.decoders import RulesDecoder, RulesOptions

SMALL = np.zeros((9, 9, 3), np.uint8)


def meter(report: SourceReport, *, live: bool = True) -> FrameMeter:
    """Return the meter of a scripted camera."""
    metric = preset_metric("paper", baseline())
    return FrameMeter(baseline(), metric, report, live=live, start_ns=STARTED_NS)


def test_a_threaded_recording_arrives_whole_and_in_order() -> None:
    ahead = ReadAhead("test", lambda _stopped: (Intent(t_ns=k * MS) for k in range(500)), capacity=4)
    stream, got = PulledStream(ahead), list[int]()
    for t in range(0, 600, 7):
        while (item := stream.next_until(t * MS)) is not None:
            assert item.t_ns <= t * MS
            got.append(item.t_ns // MS)
    assert got == list(range(500))
    assert stream.ended
    ahead.close()


def test_an_error_in_the_thread_comes_after_what_was_made_before_it() -> None:
    def produce(_stopped: Callable[[], bool]) -> Iterator[Intent]:
        yield Intent(t_ns=0)
        yield Intent(t_ns=MS)
        raise RecordingError("frame 3 is torn")

    with closing(ReadAhead("test", produce)) as ahead:
        stream = PulledStream(ahead)
        assert stream.next_until(0) == Intent(t_ns=0)
        with pytest.raises(RecordingError, match="torn"):
            stream.next_until(MS)


def test_a_live_stream_never_makes_the_loop_wait_and_loses_the_oldest() -> None:
    lost: list[int] = []
    filled = threading.Event()

    def produce(stopped: Callable[[], bool]) -> Iterator[Intent]:
        for k in range(10):
            yield Intent(t_ns=k)
        filled.set()
        while not stopped():
            threading.Event().wait(0.01)

    stream: LiveStream[Intent] = LiveStream(capacity=4, on_loss=lambda: lost.append(1))
    reader = Reader("test", produce, stream.put, stream.end)
    assert filled.wait(5)
    got = []
    while (item := stream.next_until(MS)) is not None:
        got.append(item.t_ns)
    assert got == [6, 7, 8, 9]
    assert len(lost) == 6
    assert not stream.ended
    reader.close()
    assert stream.next_until(MS) is None
    assert stream.ended


def test_a_live_stream_ends_with_its_error_after_the_items_before_it() -> None:
    stream: LiveStream[Intent] = LiveStream()
    stream.put(Intent(t_ns=1))
    stream.end(error=RecordingError("frame 3 is torn"))
    assert not stream.ended
    assert stream.next_until(MS) == Intent(t_ns=1)
    with pytest.raises(RecordingError, match="torn"):
        stream.next_until(MS)
    assert (stream.ended, stream.next_until(MS)) == (True, None)


def test_what_came_over_a_link_lapses() -> None:
    now, lost = [0], list[int]()
    stream: LiveStream[Intent] = LiveStream(clock=lambda: now[0], on_loss=lambda: lost.append(1))
    stream.put(Intent(t_ns=1), use_by_ns=10)
    stream.put(Intent(t_ns=2), use_by_ns=30)
    now[0] = 20
    assert stream.next_until(MS) == Intent(t_ns=2)
    assert len(lost) == 1


def test_closing_frees_a_thread_that_waits_for_room() -> None:
    ahead = ReadAhead("waits", lambda _stopped: (Intent(t_ns=k) for k in range(10**9)), capacity=2)
    assert "tega-waits" in {thread.name for thread in threading.enumerate()}
    ahead.close()
    assert "tega-waits" not in {thread.name for thread in threading.enumerate()}


def test_bad_frames_of_a_live_sensor_are_dropped_and_counted() -> None:
    report = SourceReport()
    script = [live_frame(0), None, live_frame(1, image=SMALL), RecordingError("torn"), live_frame(4)]
    camera: Any = ScriptedCamera(script)
    got = list(measured_contacts(camera, meter(report)))
    assert [contact.t_ns // MS for contact in got] == [0, 64]
    assert all(contact.in_contact for contact in got)
    assert (report.n_items, report.n_dropped, report.n_missing, report.lost) == (2, 2, 3, "")


def test_a_live_sensor_that_goes_away_says_why_for_as_long_as_it_is_gone() -> None:
    report = SourceReport()
    camera: Any = ScriptedCamera([live_frame(0), DeviceUnavailableError("unplugged"), live_frame(2)])
    got = list(measured_contacts(camera, meter(report), stopped=lambda: report.lost != ""))
    assert len(got) == 1
    assert report.lost == "unplugged"


def test_a_recorded_frame_of_another_size_than_its_baseline_is_an_error() -> None:
    camera: Any = ScriptedCamera([live_frame(0, image=SMALL)], live=False)
    with pytest.raises(RecordingError, match=r"frame 0: 9×9×3 pixels, its baseline has 80×60×3"):
        list(measured_contacts(camera, meter(SourceReport(), live=False)))


def test_chunk_size_does_not_change_levels_or_stamps() -> None:
    samples = np.random.default_rng(3).standard_normal((1000, 2)) * np.linspace(0, 3, 1000)[:, None]

    class Chunks:
        def __init__(self, size: int) -> None:
            self._at, self._size = 0, size
            self.info = DeviceInfo(driver="x", kind="emg", label="x", live=False, rate_hz=200.0)

        @property
        def ended(self) -> bool:
            return self._at >= len(samples)

        def read(self, timeout_s: float) -> EmgChunk:
            assert timeout_s >= 0
            first = self._at
            self._at = min(first + self._size, len(samples))
            return EmgChunk(round(self._at * 5 * MS), first, samples[first : self._at])

    def blocks(size: int) -> list[Any]:
        source: Any = Chunks(size)
        setup = MuscleSetup("raw", 200.0, 20, ("a", "b"), (2.0, 2.0), "live")
        decoder = RulesDecoder(setup, RulesOptions())
        maxima = EmgMaxima(kind="raw", rate_hz=200.0, tau=20, channels=("a", "b"), maxima=(2.0, 2.0))
        return list(grasp_blocks(source, BlockMeter(decoder, SourceReport(), maxima=maxima, live=False)))

    whole = blocks(1000)
    assert [intent.t_ns for intent in whole] == [k * 100 * MS for k in range(1, 51)]
    assert blocks(1) == blocks(7) == blocks(333) == whole
