"""Live EMG boards against their emulators, kind by kind: what each is asked, sends and is refused for."""

from __future__ import annotations

import subprocess
import sys

import pytest

from reference.emg_boards import chunks_of, emulator, error_of, opened, phases, refused
from tega.errors import DeviceUnavailableError
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--board-off",), "the dongle answers, the board does not: 'Failure: Communications timeout"),
        (("--firmware", "v1.0.0"), r"channel 1 was not confirmed: .* \(firmware v1.0.0\) did not answer"),
        (("--fault", "freeze=1"), "nothing answers"),
    ],
)
def test_a_cyton_that_cannot_be_set_up_is_refused(arguments: tuple[str, ...], text: str) -> None:
    refused(text, "cyton", *arguments)


def test_chords_boards_are_known_by_name_and_channels_by_the_stream() -> None:
    with emulator("chords", "--name", "UNO-R4", "--channels", "6", "--bits", "14") as device:
        with opened("chords", device, channels=(2, 5)) as source:
            info = source.info
        assert (info.rate_hz, info.channels) == (500.0, ("ch2", "ch5"))
        with pytest.raises(DeviceUnavailableError, match=r"has 6 channels, asked for \[2, 7\]"):
            opened("chords", device, channels=(2, 7)).open()
    with emulator("chords", "--name", "MYSTERY", "--rate", "400") as device:
        with pytest.raises(DeviceUnavailableError, match="says it is 'MYSTERY', which is not known here"):
            opened("chords", device).open()
        with opened("chords", device, rate_hz=400.0) as source:
            assert source.info.rate_hz == 400.0


@pytest.mark.parametrize("generation", ["2024", "2026"])
def test_chords_boards_of_both_generations_are_found_at_either_speed(generation: str) -> None:
    # As the sketches of UNO clones: 115200 baud is the second that is tried.
    board = ("--name", "UNO-CLONE", "--rate", "250", "--bits", "10", "--channels", "6", "--baud", "115200")
    with emulator("chords", "--generation", generation, *board) as device:
        for _ in range(2):  # the second time with the stop of the first one still unheard
            with opened("chords", device) as source:
                assert source.info.rate_hz == 250.0
                assert sum(len(chunk.samples) for chunk in chunks_of(source, 50)) >= 50


@pytest.mark.parametrize("generation", ["2024", "2026"])
def test_a_chords_board_left_streaming_by_a_crash_is_asked_again(generation: str) -> None:
    with emulator("chords", "--generation", generation) as device:
        crash = "import os, sys\nfrom tega.devices.emg.chords import Chords, ChordsOptions\n"
        crash += "Chords(ChordsOptions(port=sys.argv[1], measure_s=0.3)).open()\nos._exit(3)\n"
        assert subprocess.run([sys.executable, "-c", crash, device.port], check=False).returncode == 3
        with opened("chords", device) as source:
            chunks_of(source, 50)


@pytest.mark.parametrize("columns", [1, 2, 6])
def test_a_spikershield_sends_as_many_channels_as_it_is_told(columns: int) -> None:
    with emulator("spiker") as device, opened("spiker", device, columns=columns) as source:
        chunks = chunks_of(source, 250)
        rate_hz = source.info.rate_hz
        received = bytes.fromhex(device.say("heard")["heard"])
    phase, exact = phases("spiker", chunks)
    assert exact.all()
    assert (phase == phase[0]).all()
    assert chunks[0].samples.shape[1] == columns
    assert rate_hz == pytest.approx(2e6 / 199 / columns)
    assert set(received.splitlines()) == {f"c:{columns};".encode()}


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--deaf",), "sends 1 channels, 3 are asked for"),
        (("--deaf", "--channels", "2"), "sends 2 channels, 3 are asked for"),
        (("--fault", "freeze=1"), "sends no frames of a SpikerShield"),
        (("--fault", "garbage=1"), "sends no frames of a SpikerShield"),
    ],
)
def test_a_board_that_is_no_spikershield_is_refused(arguments: tuple[str, ...], text: str) -> None:
    refused(text, "spiker", *arguments, start_s=1.0)


def test_a_spikershield_that_restarts_under_an_open_port_stops_and_is_told_again() -> None:
    with emulator("spiker") as device, opened("spiker", device, silence_s=1.0) as source:
        chunks_of(source, 250)
        device.say("reset")
        error = error_of(source)
        assert "sent no valid sample for 1 s" in error.message
        assert "frames among them" in error.message
        source.open()
        assert len(chunks_of(source, 250))


def test_lines_of_another_kind_are_quoted() -> None:
    text = r"a line of 4 numbers was expected, the last one was '\d+,\d+,\d+'"
    refused(text, "serial-emg", "--channels", "2", "--stamp", leading=1, start_s=0.5)


def test_a_stamp_before_the_samples_is_dropped() -> None:
    with (
        Emulator("ascii_board", "--stamp", "--banner", "MyoWare 2.0") as device,
        opened("serial-emg", device, leading=1) as source,
    ):
        phase, exact = phases("serial-emg", chunks_of(source, 100))
    assert exact.all()
    assert (phase == phase[0]).all()


def test_an_irregular_stream_needs_its_rate_told() -> None:
    with Emulator("lsl", "--stated-rate", "0") as device:
        with pytest.raises(DeviceUnavailableError, match=r"states no sample rate; set rate_hz"):
            opened("lsl-emg", device).open()
        with opened("lsl-emg", device, rate_hz=500.0) as source:
            assert source.info.rate_hz == 500.0
