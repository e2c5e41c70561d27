"""What a loop reads from: recordings, live sensors and links, opened again where they go away; presses, baselines."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from reference.recordings import baseline
from reference.scripted import MS, STARTED_NS, ScriptedCamera, live_frame
from tega.config.choose import preset_metric
from tega.devices.base import DeviceInfo, EmgChunk, InputEvent, InputReading, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.loop.inbox.frames import FrameMeter, measured_contacts
from tega.loop.inbox.inputs import Inputs, Seat
from tega.loop.inbox.reader import ReadAhead, Reader
from tega.loop.inbox.sources import SourceReport, chunk_of, frame_of, picture_of, samples_of
from tega.loop.inbox.stream import LiveStream, PulledStream
from tega.loop.prepare import find_baseline
from tega.records import Button, Intent, Marker
from tega.records.bus import Bus
from tega.runtime.reopening import Reopening, polled

SMALL = np.zeros((9, 9, 3), np.uint8)


def meter(report: SourceReport, *, live: bool = True) -> FrameMeter:
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


def test_a_live_sensor_that_goes_away_says_why_for_as_long_as_it_is_gone() -> None:
    report = SourceReport()
    camera: Any = ScriptedCamera([live_frame(0), DeviceUnavailableError("unplugged"), live_frame(2)])
    got = list(measured_contacts(camera, meter(report), stopped=lambda: report.lost != ""))
    assert len(got) == 1
    assert (report.lost, report.end_ns) == ("unplugged", None)


def test_a_recorded_frame_of_another_size_than_its_baseline_is_an_error() -> None:
    camera: Any = ScriptedCamera([live_frame(0, image=SMALL)], live=False)
    with pytest.raises(RecordingError, match=r"frame 0: 9×9×3 pixels, its baseline has 80×60×3"):
        list(measured_contacts(camera, meter(SourceReport(), live=False)))


@pytest.mark.parametrize(("live", "t_ns"), [(True, 123_000), (False, 130_000)])
def test_samples_of_a_live_source_count_from_the_start_of_the_session(*, live: bool, t_ns: int) -> None:
    chunk = EmgChunk(130_000, 5, np.arange(6.0).reshape(3, 2))
    record = samples_of(chunk, live=live, start_ns=7_000)
    assert (record.t_ns, record.first_index, record.n_channels) == (t_ns, 5, 2)
    assert live or record.received_ns == t_ns
    again = chunk_of(record)
    assert again.samples.tolist() == chunk.samples.tolist()


def test_a_picture_counts_from_the_start_of_the_session_and_is_no_new_baseline_unless_it_is_said() -> None:
    frame = TactileFrame(130_000, 4, np.zeros((2, 3, 3), np.uint8), "4.png")
    record = picture_of("thumb", frame, received_ns=131_000, start_ns=7_000)
    assert (record.t_ns, record.received_ns) == (123_000, 124_000)
    assert (record.loaded, record.rezeroed) == (False, False)
    assert frame_of(record)[1:] == frame[1:]


class Frames:
    def __init__(self, n: int) -> None:
        self.n, self.n_read = n, 0
        self.info = SimpleNamespace(n_items=n, live=False, label="frames", driver="images")

    @property
    def ended(self) -> bool:
        return self.n_read >= self.n

    def read(self, _timeout_s: float) -> TactileFrame:
        self.n_read += 1
        return TactileFrame(self.n_read, self.n_read, np.full((8, 8, 3), 90, np.uint8), "")

    def open(self) -> None: ...


def test_a_baseline_is_of_frames_at_even_distances_and_compared_with_five_at_most_30_apart(tmp_path) -> None:
    for n, used in ((60, 60), (96, 96), (97, 49), (960, 96)):
        estimated: Any = Frames(n)
        assert f" {used} frames" in find_baseline(estimated, None, finger="thumb")[1]
    cv2.imwrite(str(tmp_path / "rest.png"), np.full((8, 8, 3), 90, np.uint8))
    for n, read in ((3, 3), (100, 100), (103, 100), (1000, 150)):
        source: Any = Frames(n)
        find_baseline(source, tmp_path / "rest.png", finger="thumb")
        assert source.n_read == read


START_NS, PRESSED_NS = 7_000_000_000, 7_250_000_000


def one_button(*, live: bool = True) -> Mock:
    reading = InputReading(PRESSED_NS, live=live, motion=(0.0,) * 6, held=frozenset({"a"}))
    press = InputEvent(t_ns=PRESSED_NS, seq=1, button="a", pressed=True)
    source = Mock(spec=["info", "state", "events"])
    source.info = DeviceInfo(driver="own", kind="input", label="a button", live=True)
    source.state.return_value = reading
    source.events.side_effect = [[press], [], [], []]
    return source


def looked_at(source: Any, bus: Bus, n_checks: int) -> Inputs:
    pacer: Any = SimpleNamespace(start_ns=START_NS, elapsed_ns=lambda: PRESSED_NS - START_NS + 1_000_000)
    inputs = Inputs({"marker": Seat(source, "a")})
    for _ in range(n_checks):
        inputs.check(bus, pacer)
    return inputs


def test_a_press_has_the_time_at_which_it_was_reported() -> None:
    bus, seen = Bus(), list[Button | Marker]()
    bus.subscribe(Button, seen.append, vital=True)
    bus.subscribe(Marker, seen.append, vital=True)
    inputs = looked_at(one_button(), bus, 2)
    assert [type(one) for one in seen] == [Button, Marker]
    assert [one.t_ns for one in seen] == [PRESSED_NS - START_NS] * 2
    assert inputs.seen["marker"].n_presses == 1


def test_the_share_without_data_is_of_the_looks() -> None:
    for live, n_checks, share in ((False, 1, 1.0), (False, 4, 1.0), (True, 4, 0.0), (False, 0, 0.0)):
        summary = looked_at(one_button(live=live), Bus(), n_checks).summary()
        assert summary["marker"]["no_data_share"] == share


class Rests:
    """Notes how long was waited, and ends after so many rests."""

    def __init__(self, most: int = 100) -> None:
        self.most, self.s = most, list[float]()

    def __call__(self, rest_s: float) -> bool:
        if rest_s:
            self.s.append(rest_s)
        return len(self.s) > self.most


def failing(n: int, error: Exception) -> Callable[[], str]:
    return Mock(side_effect=[*[error] * n, *["link"] * 9])


def test_rests_grow_to_the_longest_and_begin_anew_once_it_worked() -> None:
    rests, again, reported = Rests(), Reopening(0.25, 2.0), list[str]()
    opened = failing(5, DeviceUnavailableError("away"))
    link = again.open(opened, rests, absent=DeviceUnavailableError, refused=lambda e: reported.append(str(e)))
    assert link == "link"
    assert reported == ["away"] * 5
    assert rests.s == [0.25, 0.5, 1.0, 2.0, 2.0, 2.0]
    again.works()
    again.wait(rests)
    assert rests.s[-1] == 0.25


def test_an_error_that_says_nothing_of_absence_is_not_swallowed() -> None:
    opened = failing(1, ValueError("a fault of ours"))
    with pytest.raises(ValueError, match="a fault of ours"):
        Reopening(0.1, 1.0).open(opened, Rests(), absent=DeviceUnavailableError)


def test_a_device_is_used_let_go_of_and_opened_again_until_it_is_not_wanted() -> None:
    rests, done = Rests(3), list[str]()
    opened = failing(1, OSError("away"))

    def use(link: str) -> bool:
        done.append(f"use {link}")
        return link == "first"

    Reopening(0.25, 2.0).serve("first", opened, use, lambda link: done.append(f"close {link}"), rests)
    assert done[:4] == ["use first", "close first", "use link", "close link"]
    assert done[-1] == "close link"
    assert rests.s[:2] == [0.25, 0.5]


def test_a_device_is_let_go_of_and_opened_again_whatever_its_use_ends_with() -> None:
    closed, reported, use = (
        list[str](),
        list[Exception](),
        Mock(side_effect=[1 / 3, error := KeyError("x"), 1]),
    )
    Reopening(0.1, 1.0).serve("it", lambda: "it", use, closed.append, Rests(2), refused=reported.append)
    assert (closed, reported) == (["it"] * 3, [error])


def test_who_only_polls_is_asked_while_the_rest_lasts() -> None:
    looks = iter([False, False, True])
    assert polled(lambda: next(looks), every_s=0.001)(60.0)
    assert not polled(lambda: False, every_s=0.001)(0.002)


class Reopened(ScriptedCamera):
    n_opened = 0

    def open(self) -> None:
        self.n_opened += 1


def test_a_camera_that_goes_away_is_opened_again_as_an_amplifier_is() -> None:
    lost = DeviceUnavailableError("mine: unplugged")
    camera, report = Reopened([*map(live_frame, range(3)), lost] * 2 + [live_frame(0)]), SourceReport()
    source: Any = camera
    stream = measured_contacts(source, meter(report))
    assert [next(stream).t_ns // MS for _ in range(7)] == [0, 16, 32, 0, 16, 32, 0]
    assert (camera.n_opened, report.n_lost, report.lost, report.n_missing) == (2, 2, "", 0)
