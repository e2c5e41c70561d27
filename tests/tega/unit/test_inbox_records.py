"""What a source has read: records and their times, presses at the device's time, frames of a baseline."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from tega.devices.base import DeviceInfo, EmgChunk, InputEvent, InputReading, TactileFrame
from tega.loop.inbox.inputs import Inputs, Seat
from tega.loop.inbox.sources import chunk_of, frame_of, picture_of, samples_of
from tega.loop.prepare import find_baseline
from tega.records import Button, Marker
from tega.records.bus import Bus

BEGAN_NS = 7_000


@pytest.mark.parametrize(("live", "t_ns"), [(True, 123_000), (False, 130_000)])
def test_samples_of_a_live_source_count_from_the_start_of_the_session(*, live: bool, t_ns: int) -> None:
    chunk = EmgChunk(130_000, 5, np.arange(6.0).reshape(3, 2))
    record = samples_of(chunk, live=live, start_ns=BEGAN_NS)
    assert (record.t_ns, record.first_index, record.n_channels) == (t_ns, 5, 2)
    assert live or record.received_ns == t_ns
    again = chunk_of(record)
    assert again.samples.tolist() == chunk.samples.tolist()


def test_a_picture_counts_from_the_start_of_the_session_and_is_no_new_baseline_unless_it_is_said() -> None:
    frame = TactileFrame(130_000, 4, np.zeros((2, 3, 3), np.uint8), "4.png")
    record = picture_of("thumb", frame, received_ns=131_000, start_ns=BEGAN_NS)
    assert (record.t_ns, record.received_ns) == (123_000, 124_000)
    assert (record.loaded, record.rezeroed) == (False, False)
    assert frame_of(record)[1:] == frame[1:]


class Frames:
    """A recording of so many small frames."""

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


def test_a_baseline_is_estimated_from_frames_at_even_distances() -> None:
    for n, used in ((60, 60), (96, 96), (97, 49), (960, 96)):
        source: Any = Frames(n)
        assert f" {used} frames" in find_baseline(source, None, finger="thumb")[1]


def test_a_given_baseline_is_compared_with_five_frames_at_distances_of_at_most_30(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "rest.png"), np.full((8, 8, 3), 90, np.uint8))
    for n, read in ((3, 3), (100, 100), (103, 100), (1000, 150)):
        source: Any = Frames(n)
        find_baseline(source, tmp_path / "rest.png", finger="thumb")
        assert source.n_read == read


START_NS, PRESSED_NS = 7_000_000_000, 7_250_000_000


class OneButton:
    """An input device with one button, which was pressed once."""

    info = DeviceInfo(driver="own", kind="input", label="a button", live=True)

    def __init__(self, *, live: bool = True) -> None:
        self._live = live
        self._events = [InputEvent(t_ns=PRESSED_NS, seq=1, button="a", pressed=True)]

    def state(self) -> InputReading:
        return InputReading(PRESSED_NS, live=self._live, motion=(0.0,) * 6, held=frozenset({"a"}))

    def events(self) -> list[InputEvent]:
        events, self._events = self._events, []
        return events


def looked_at(source: Any, bus: Bus, n_checks: int) -> Inputs:
    """Return the inputs after some looks at a marker."""
    pacer: Any = SimpleNamespace(start_ns=START_NS, elapsed_ns=lambda: PRESSED_NS - START_NS + 1_000_000)
    inputs = Inputs({"marker": Seat(source, "a")})
    for _ in range(n_checks):
        inputs.check(bus, pacer)
    return inputs


def test_a_press_has_the_time_at_which_it_was_reported() -> None:
    bus, seen = Bus(), list[Button | Marker]()
    bus.subscribe(Button, seen.append, vital=True)
    bus.subscribe(Marker, seen.append, vital=True)
    inputs = looked_at(OneButton(), bus, 2)
    assert [type(one) for one in seen] == [Button, Marker]
    assert [one.t_ns for one in seen] == [PRESSED_NS - START_NS] * 2
    assert inputs.seen["marker"].n_presses == 1


def test_the_share_without_data_is_of_the_looks() -> None:
    for live, n_checks, share in ((False, 1, 1.0), (False, 4, 1.0), (True, 4, 0.0), (False, 0, 0.0)):
        summary = looked_at(OneButton(live=live), Bus(), n_checks).summary()
        assert summary["marker"]["no_data_share"] == share
