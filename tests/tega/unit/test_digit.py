"""The DIGIT's driver on an emulated sensor in another process, read by the same ``VideoCapture``."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tega.devices.fingertip.digit
from reference.processes import until
from tega.devices.fingertip.digit import Digit, DigitOptions
from tega.devices.fingertip.picture_check import (
    Origin,
    PictureTally,
    judge_picture,
    picture_origin,
    sensor_bands,
)
from tega.errors import ConfigError, DeviceUnavailableError, RecordingError
from tega.loop.inbox.frames import fed_contacts, keeps_up
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import LiveStream
from tega.runtime.device_items import CameraCounts, TactileFrame
from tega_emulators.digit import FAULTS
from tega_emulators.process import Emulator


def _driver(sensor: Emulator, **options: Any) -> Digit:
    make: Any = DigitOptions
    return Digit(make(**{"source": sensor.address["source"], "warm_up_s": 0.1, **options}))


@pytest.mark.slow
def test_it_gives_the_newest_picture_once_and_turned() -> None:
    with Emulator("digit") as sensor, _driver(sensor) as digit:
        first = digit.read(5.0)
        assert first is not None
        assert first.image.shape == (320, 240, 3)
        # Sent with blue rising downwards: turned against the clock it rises to the right.
        means = first.image[:, :, 0].mean(axis=0)
        assert means[-20:].mean() > means[:20].mean() + 20
        time.sleep(0.3)
        second = digit.read(5.0)
        assert second is not None
        assert second.seq > first.seq + 5
        assert first.t_ns < second.t_ns <= time.monotonic_ns()
    with pytest.raises(DeviceUnavailableError, match="not open"):
        digit.read(0.0)
    assert digit.counts.lost == 0


@pytest.mark.slow
@pytest.mark.parametrize("decodes_at_once", [True, False])
def test_pictures_that_waited_for_a_busy_program_are_not_taken_for_new_ones(
    decodes_at_once: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not decodes_at_once:  # a starved processor takes so long for each that none seems to have waited
        monkeypatch.setattr(tega.devices.fingertip.digit, "_AT_ONCE", 0.0)
    goes_on, seen = threading.Event(), list[TactileFrame]()

    def take(frame: TactileFrame) -> None:
        seen.append(frame)
        goes_on.wait(20.0)

    with Emulator("digit") as sensor, _driver(sensor) as digit:
        digit.feed(take)
        until(lambda: bool(seen))
        time.sleep(2.0)  # some 120 pictures wait in the stream meanwhile
        sensor.say("black")
        time.sleep(0.2)
        goes_on.set()
        until(lambda: digit.counts.black > 0)
        n_old = len(seen)
        digit.feed(None)
    assert n_old < 20


@pytest.mark.slow
@pytest.mark.parametrize("terminated", [False, True])
def test_a_program_that_does_not_close_it_still_ends_in_order(terminated: bool) -> None:
    end = "os.kill(os.getpid(), signal.SIGTERM)\ntime.sleep(60)" if terminated else ""
    with Emulator("digit") as sensor:
        program = (
            "import os, signal, time\n"
            "from tega.devices.fingertip.digit import Digit, DigitOptions\n"
            f"digit = Digit(DigitOptions(source={sensor.address['source']!r}, warm_up_s=0.1))\n"
            f"digit.open()\n{end}\n"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM if terminated else 0, "")


COUNTED = {fault: fault for fault in ("black", "torn", "duplicate")} | {"freeze": "stuck"}
COUNTED |= dict.fromkeys(("pause", "cut", "garbage"), "lost")


def test_every_fault_of_the_emulated_sensor_is_tried() -> None:
    assert set(COUNTED) | {"small", "slow", "other", "strip"} == set(FAULTS)


@pytest.mark.slow
@pytest.mark.parametrize("fault", sorted(COUNTED))
def test_a_fault_is_counted_silences_and_is_survived(fault: str) -> None:
    with Emulator("digit") as sensor, _driver(sensor) as digit:
        sensor.say(fault)
        until(lambda: getattr(digit.counts, COUNTED[fault]) > 0)
        if fault != "duplicate":
            until(lambda: digit.read(0.1) is None)
        assert (digit.read(0.2) is not None) == (fault == "duplicate")
        sensor.say("clear")
        until(lambda: digit.read(0.1) is not None)


@pytest.mark.slow
@pytest.mark.parametrize("orientation", ["upright", "as-sent"])
def test_another_sensor_s_lines_are_named_and_withheld(orientation: str) -> None:
    with Emulator("digit") as one, Emulator("digit", "--look", "1") as two:
        with _driver(two, orientation=orientation) as next_finger:
            theirs = next_finger.read(5.0)
        with _driver(one, orientation=orientation) as digit:
            own = digit.read(5.0)
            assert own is not None
            assert theirs is not None
            digit.compare_with(own.image, {"index (D20002)": theirs.image})
            assert digit.read(5.0) is not None
            assert not digit.info.notes
            for fault, share in (("strip", 8), ("other", 100)):
                one.say(fault)
                enough = digit.counts.foreign + 4
                until(partial(lambda n: digit.counts.foreign >= n, enough))
                until(lambda: digit.read(0.1) is None)
                note = digit.info.notes[0]
                assert f"lines of the sensor of index (D20002) (up to {share} % of a picture)" in note
                one.say("clear")
                until(lambda: digit.read(0.1) is not None)
            digit.compare_with(own.image, {})
            one.say("other")
            until(lambda: digit.counts.unlike > 3)
            assert digit.read(5.0) is not None
            assert "unlike the baseline" in digit.info.notes[-1]


@pytest.mark.slow
def test_as_sent_and_another_size() -> None:
    with Emulator("digit") as sensor:
        with _driver(sensor, orientation="as-sent") as digit:
            frame = digit.read(5.0)
            assert frame is not None
            assert frame.image.shape == (240, 320, 3)
        # FFmpeg scales what changes size under way, so only an opening can tell.
        sensor.say("small")
        with pytest.raises(DeviceUnavailableError, match=r"no good picture.*[1-9]\d* not 320×240"):
            _driver(sensor).open()


@pytest.mark.parametrize(
    "options",
    [{}, {"serial": "D1", "source": "x"}, {"source": "x", "led": (16, 0, 0)}, {"source": "/dev/video97"}],
)
def test_settings_that_cannot_be(options: dict[str, Any]) -> None:
    make: Any = DigitOptions
    with pytest.raises((ConfigError, DeviceUnavailableError), match=r"either|0 to 15|no /dev/video97"):
        Digit(make(**options)).open()


def test_a_picture_with_the_end_of_the_one_before_is_torn() -> None:
    random = np.random.default_rng(0)
    counts = CameraCounts()
    tally, last = PictureTally(counts), None

    def judged(image: Any) -> str:
        nonlocal last
        tally.count(judge_picture(image, last))
        last = image
        return tally.newest

    one, two = (random.integers(60, 120, (240, 320, 3), dtype=np.uint8) for _ in range(2))
    assert judged(one) == "good"
    assert judged(np.concatenate([two[:200], one[200:]])) == "torn"
    assert judged(two) == "good"
    assert [judged(two.copy()) for _ in range(4)] == ["duplicate"] * 4
    assert (counts.stuck, counts.duplicate, counts.torn, counts.used) == (1, 4, 1, 2)


def test_lines_of_another_real_sensor_are_found_and_no_press_is_taken_for_one(recordings: Path) -> None:
    cv2: Any = pytest.importorskip("cv2")
    folder = recordings / "digit"

    def sent(image: Any) -> Any:
        return np.ascontiguousarray(np.rot90(image, -1))

    own = sent(cv2.imread(str(folder / "digit_ball_D20641" / "background.png")))
    other = sent(np.load(folder / "digit_backgrounds" / "ncf_bg_D20479.npy"))
    baselines = sensor_bands(own, {"D20479": other})
    frames = sorted((folder / "digit_ball_D20641").glob("frame_*.png"))
    assert len(frames) > 20
    for file in frames:
        image = sent(cv2.imread(str(file)))
        assert picture_origin(image, baselines) == Origin("", 0.0, unlike=False), file.name
        for first in range(0, 217, 8):
            mixed = image.copy()
            mixed[first : first + 24] = other[first : first + 24]
            assert picture_origin(mixed, baselines).other == "D20479", (file.name, first)
    assert picture_origin(other, baselines).share == 1.0


@pytest.mark.slow
def test_a_sensor_that_sends_too_few_pictures_is_told() -> None:
    with Emulator("digit") as sensor, _driver(sensor) as digit:
        sensor.say("slow")
        until(lambda: any("pictures a second came for a while where 60" in n for n in digit.info.notes))
        assert digit.read(5.0) is not None


def test_a_metric_that_is_too_slow_for_the_camera_gets_a_thread_of_its_own() -> None:
    class Slow:
        memory = False

        def update(self, _image: Any, _t_ns: int) -> None:
            time.sleep(0.01)

    slow: Any = Slow()
    for rate_hz in (60.0, None):
        assert not keeps_up(slow, np.zeros((4, 4, 3), np.uint8), rate_hz=rate_hz)


def test_what_nobody_expected_in_a_camera_s_thread_reaches_the_loop() -> None:
    stream: LiveStream[Any] = LiveStream()
    report, frame = SourceReport(), TactileFrame(0, 0, np.zeros((4, 4, 3), np.uint8), "picture 0")
    errors = iter([RecordingError("torn"), ZeroDivisionError("a bug")])
    meter: Any = SimpleNamespace(report=report, take=lambda _frame: (_ for _ in ()).throw(next(errors)))
    measure = fed_contacts(meter, stream.put, lambda error: stream.end(error=error))
    measure(frame)
    assert (report.n_dropped, stream.next_until(1)) == (1, None)
    measure(frame)
    with pytest.raises(ZeroDivisionError, match="bug"):
        stream.next_until(1)
