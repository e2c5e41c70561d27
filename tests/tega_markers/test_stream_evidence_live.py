"""Live streams that contradict themselves, from emulators on real transports: refused, or reported by name."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.emg_boards import chunks_of, opened, refused
from reference.kept import muscle_file
from reference.processes import until
from tega.config import check_tree
from tega.devices.emg.live_emg import LiveEmg
from tega.devices.emg.serial_emg import SerialEmg, SerialEmgOptions
from tega.devices.fingertip.digit import Digit, DigitOptions
from tega.errors import StreamContradictionError
from tega.loop import run_session
from tega.setup.doctor import examine
from tega_emulators.process import Emulator
from tega_lsl.emg import LslEmg, LslEmgOptions
from tega_markers.lsl_streams import LslMarkersIn, ReceivedMarker

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals")]

pytest.importorskip("pylsl")


def rows_of(source: LiveEmg, n: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.concatenate([chunk.samples for chunk in chunks_of(source, n)])


def test_a_daisy_is_taken_off_and_the_board_alone_is_read() -> None:
    with (
        Emulator("cyton", "--signal", "flat", "--daisy", "obeys") as device,
        opened("cyton", device) as source,
    ):
        assert not rows_of(source, 250).any()
        assert "its Daisy switched off" in source.info.notes[0]
        assert source.contradictions == ()


@pytest.mark.parametrize(
    ("arguments", "message", "hint"),
    [
        (("--daisy", "deaf"), "banner: a Daisy is attached, and the board does not answer to", "Daisy"),
        (("--daisy", "hidden"), "values: packets of even and of odd number show different", "Daisy"),
        (("--shifted", "1.0"), "counter: the counter does not move", "radio firmware"),
        (("--shifted", "0.6"), "counter: the counter does not move", "radio firmware"),
    ],
)
@pytest.mark.parametrize("signal", ["flat", "emg"])
def test_a_daisy_that_stays_and_shifted_packets_are_refused(
    arguments: tuple[str, ...], message: str, hint: str, signal: str
) -> None:
    error = refused(message, "cyton", "--signal", signal, *arguments)
    assert isinstance(error, StreamContradictionError)
    assert hint in error.hint


def test_single_shifted_packets_are_left_out() -> None:
    with (
        Emulator("cyton", "--signal", "flat", "--shifted", "0.05") as device,
        opened("cyton", device) as source,
    ):
        # Where the true number is the second header's 0x41, nothing in the packet shows the shift.
        assert rows_of(source, 500).any(axis=1).sum() <= 2
        assert any("had a number that cannot be true; not used" in note for note in source.info.notes)


def test_a_column_that_counts_and_a_range_that_is_wrong_are_reported(tmp_path: Path) -> None:
    options = {"rate_hz": 500.0, "columns": 4, "bits": 8}
    with Emulator("ascii_board", "--stamp", "--rate", "500", "--signal", "emg") as device:
        with SerialEmg(SerialEmgOptions(port=device.port, **options)) as source:  # type: ignore[arg-type]
            rows_of(source, 1200)
            message = " ".join(map(str, source.contradictions))
            assert set(map(str, source.contradictions)) <= set(source.faults)
        assert "values: ch1 changes by" in message
        assert "the converter is said to give 0 to 255" in message
        tree = {"emg": {"driver": "serial-emg", "kind": "raw", "options": {"port": device.port, **options}}}
        report = examine(check_tree(tree, {}, base=tmp_path).config, name="lab.toml")
    assert [one.status for one in report.findings if "values: ch1 changes" in one.finding] == ["error"]


def ages_of(source: LiveEmg, seconds: float) -> list[float]:
    ages, until_s = list[float](), time.monotonic() + seconds
    while time.monotonic() < until_s:
        if (chunk := source.read(0.2)) is not None:
            ages.append((time.monotonic_ns() - chunk.t_ns) / 1e9)
    return ages


@pytest.mark.parametrize("stamps", ["unix", "device", "ahead"])
def test_stamps_of_another_clock_give_way_to_arrivals_and_are_reported(stamps: str) -> None:
    with (
        Emulator("lsl", "--stamps", stamps, "--signal", "emg") as device,
        opened("lsl-emg", device) as source,
    ):
        assert float(np.median(ages_of(source, 1.5))) < 0.2
        assert [one.evidence for one in source.contradictions] == ["stamp"]
        assert "they are of another clock" in source.faults[0]


def test_samples_that_are_late_for_good_are_refused_with_the_true_reason() -> None:
    error = refused(r"stamp: samples come 2\.\d+ s after their stamps", "lsl-emg", "--stamps", "late")
    assert isinstance(error, StreamContradictionError)


def test_a_clock_that_is_set_back_while_it_sends_is_reported_and_no_sample_grows_old() -> None:
    with Emulator("lsl", "--signal", "emg") as device, opened("lsl-emg", device) as source:
        assert source.contradictions == ()
        ages_of(source, 0.5)
        device.say("stamps late")
        assert float(np.median(ages_of(source, 1.5))) < 0.2
        assert "the sender's clock was set" in source.faults[0]
        # The correction is asked for again each second: once, and a clock that drifts would make samples old.
        assert "(asked 1 times" not in next(note for note in source.info.notes if "clock correction" in note)


@pytest.mark.parametrize("declared", ["Accelerometer", "Markers", "Gaze"])
def test_a_stream_that_declares_itself_as_something_else_is_reported(declared: str) -> None:
    with Emulator("lsl", "--type", declared) as device, opened("lsl-emg", device) as source:
        assert [one.evidence for one in source.contradictions] == ["banner"]
        assert declared in source.faults[0]


def test_two_streams_of_one_name_are_refused() -> None:
    with (
        Emulator("lsl", "--name", "tega-twice"),
        Emulator("lsl", "--name", "tega-twice"),
        pytest.raises(StreamContradictionError, match="banner: 2 streams have the name 'tega-twice'"),
    ):
        LslEmg(LslEmgOptions(by="name", value="tega-twice", start_s=10.0)).open()


def test_two_streams_of_markers_of_one_name_are_refused_until_one_is_gone() -> None:
    received: list[ReceivedMarker] = []
    with Emulator("lsl_markers", "--name", "tega-marks") as one:
        with Emulator("lsl_markers", "--name", "tega-marks"):
            listening = LslMarkersIn("tega-marks", received.append)
            until(lambda: "2 streams are called 'tega-marks'" in listening.problem)
            assert not received
        until(lambda: listening.problem == "")
        # A second one that comes later is named as well, and the first is still heard.
        with Emulator("lsl_markers", "--name", "tega-marks"):
            until(lambda: "2 streams are called" in listening.problem)
            until(lambda: bool(one.say("mark there")["consumers"]))
            until(lambda: bool(received))
        until(lambda: listening.problem == "")
        listening.close()
    assert {one.text for one in received} == {"there"}


@pytest.mark.parametrize("odd_marker", ["mark odd -1.7e9", "mark odd -10", "mark odd 500", "mark-latin odd"])
def test_a_marker_of_another_clock_or_coding_is_reported_and_its_arrival_counts(odd_marker: str) -> None:
    received: list[ReceivedMarker] = []
    with Emulator("lsl_markers", "--name", "tega-odd") as other:
        listening = LslMarkersIn("tega-odd", received.append)
        until(lambda: listening.problem == "")
        until(lambda: bool(other.say("mark good")["consumers"]) and bool(received))
        assert listening.n_unstamped == 0
        other.say(odd_marker)
        why = "is of another clock" if odd_marker.startswith("mark ") else "'odd\ufffd', which is not UTF-8"
        until(lambda: why in listening.problem)
        other.say(f"mark {'x' * 2_000_000}")  # more than may be recorded
        until(lambda: "50 kB a second, 1 not recorded" in listening.problem)
        listening.close()
    odd = next(marker for marker in received if marker.text.startswith("odd"))
    assert odd.at_ns == odd.received_ns
    assert (listening.n_unstamped, listening.budget.n_left_out) == (1, 1)
    good = next(marker for marker in received if marker.text == "good")
    assert abs(good.received_ns - good.at_ns) < 5e9


def test_a_camera_that_changes_its_size_falls_silent_with_the_reason() -> None:
    with (
        Emulator("digit") as sensor,
        Digit(DigitOptions(source=sensor.address["source"], warm_up_s=0.1)) as digit,
    ):
        assert digit.read(5.0) is not None
        sensor.say("small")
        until(lambda: "those that come are of another size" in digit.faults)
        digit.read(0.0)
        assert digit.read(0.5) is None
        sensor.say("clear")
        until(lambda: digit.read(0.5) is not None)
        assert digit.faults == ()


def test_the_alert_of_a_contradiction_is_in_the_summary(tmp_path: Path) -> None:
    calibration = {"file": str(muscle_file(tmp_path, 50.0, 50.0, 50.0, rate_hz=500.0))}
    with Emulator("lsl", "--stamps", "unix", "--signal", "emg") as device:
        options = {"by": "source_id", "value": device.port}
        emg = {"driver": "lsl-emg", "kind": "raw", "options": options}
        tree = {"session": {"duration_s": 2.0}, "emg": emg, "calibration": calibration}
        summary = run_session(check_tree(tree, {}, base=tmp_path).config)
    text = json.dumps(summary)
    assert any("stamp: the stamps lie" in alert for alert in summary["safety"]["alerts"]), text
