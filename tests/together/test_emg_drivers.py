"""The live EMG drivers against their emulators: exact samples, what each board receives, every fault's outcome."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from reference.emg_boards import CASES, chunks_of, emulator, error_of, opened, phases, refused
from reference.processes import until
from tega.devices.base import EmgChunk
from tega.devices.emg import live_emg
from tega.devices.emg.serial_emg import SerialEmg, SerialEmgOptions
from tega.errors import DeviceUnavailableError, SampleRateError
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow
COUNTED = ("cyton", "chords")
# Silence and loss are told by the port or the network, whatever the board is.
TRANSPORTS = ("cyton", "lsl-emg")


def assert_exact(name: str, chunks: list[EmgChunk]) -> None:
    phase, exact = phases(name, chunks)
    assert exact.all()
    assert (phase == phase[0]).all()


@pytest.mark.parametrize("name", sorted(CASES))
def test_samples_are_exact_and_none_is_lost(name: str) -> None:
    n_samples = 3000 if name == "spiker" else 250  # about a second of each
    with emulator(name) as device, opened(name, device) as source:
        chunks = chunks_of(source, n_samples)
        assert source.info.label not in {"", device.port if name != "lsl-emg" else ""}
        assert source.measured_hz == pytest.approx(source.info.rate_hz, rel=0.1)
    assert_exact(name, chunks)
    assert chunks[0].first_index == 0
    assert all(0 < chunk.t_ns <= time.monotonic_ns() for chunk in chunks)
    assert chunks[0].samples.shape[1] == 3


@pytest.mark.parametrize("name", ["cyton", "serial-emg"])
def test_what_waited_before_the_first_read_is_neither_delivered_nor_called_lost(name: str) -> None:
    with emulator(name) as device, opened(name, device) as source:
        time.sleep(1.5)  # three times what a port's buffer holds of a Cyton
        called_ns = time.monotonic_ns()
        chunks = chunks_of(source, 100)
        assert not [note for note in source.info.notes if "lost" in note]
    assert_exact(name, chunks)
    assert chunks[0].first_index == 0
    assert chunks[-1].t_ns > called_ns


@pytest.mark.parametrize("name", COUNTED)
@pytest.mark.parametrize("fault", ["loss 0.1", "half 0.1", "duplicate 0.2"])
def test_lost_torn_and_repeated_packets_leave_every_sample_its_number(name: str, fault: str) -> None:
    with emulator(name) as device, opened(name, device) as source:
        device.say(fault)
        chunks = chunks_of(source, 250)
        notes = " ".join(source.info.notes)
    phase, exact = phases(name, chunks)
    # Half a packet can be filled up by the next one's bytes; there is no checksum that would tell.
    assert exact.mean() > 0.95
    assert (phase[exact] == phase[exact][0]).mean() > 0.95
    if fault.startswith("duplicate"):
        assert "packets came twice; used once" in notes
        assert chunks[-1].first_index < 400
    else:
        assert "samples were lost in" in notes
    if fault.startswith("half"):
        assert "bytes belonged to no packet" in notes


@pytest.mark.parametrize("name", TRANSPORTS)
def test_a_device_that_freezes_is_told_after_the_silence_allowed(name: str) -> None:
    with emulator(name) as device, opened(name, device, silence_s=1.0) as source:
        chunks_of(source, 20)
        device.say("freeze")
        error = error_of(source)
        assert "sent no valid sample for 1 s" in error.message
        with pytest.raises(DeviceUnavailableError, match="sent no valid sample"):
            source.read(0.0)


@pytest.mark.parametrize("name", TRANSPORTS)
def test_a_device_that_is_unplugged_is_lost_and_comes_back_when_opened_again(name: str) -> None:
    with emulator(name) as device:
        with opened(name, device) as source:
            chunks_of(source, 20)
            device.say("unplug")
            assert "was lost" in error_of(source).message
        device.say("plug")
        with opened(name, device) as source:
            assert chunks_of(source, 20)[0].first_index == 0


@pytest.mark.parametrize("name", [*COUNTED, "spiker"])
def test_a_board_that_restarts_under_an_open_port_stops_and_starts_when_opened_again(name: str) -> None:
    with emulator(name) as device, opened(name, device, silence_s=1.0) as source:
        chunks_of(source, 250 if name == "spiker" else 20)
        device.say("reset")
        message = error_of(source).message
        assert "sent no valid sample for 1 s" in message
        assert name != "spiker" or "frames among them" in message
        source.open()
        assert len(chunks_of(source, 250 if name == "spiker" else 20))


@pytest.mark.parametrize("name", ["cyton", "lsl-emg"])
def test_a_source_slower_than_it_should_be_is_refused(name: str) -> None:
    with emulator(name) as device:
        device.say("slow 0.7")
        source = opened(name, device)
        with pytest.raises(SampleRateError, match=r"really sends \d+\.\d samples/s, (250|500) were expected"):
            source.open()
        device.say("slow 0.2")
        with pytest.raises(SampleRateError, match="the 50 Hz filter needs 125"):
            source.open()


def test_a_source_that_becomes_slow_is_given_up_and_one_that_is_said_to_be_is_not_measured() -> None:
    with emulator("serial-emg") as device:
        with pytest.raises(SampleRateError, match="is said to send 20 samples/s; the 50 Hz filter needs 125"):
            opened("serial-emg", device, rate_hz=20.0).open()
        with opened("serial-emg", device) as source:
            device.say("slow 0.3")
            error = error_of(source)
    assert isinstance(error, SampleRateError)
    assert "500 were expected" in error.message or "needs 125" in error.message


def test_signal_faults_reach_the_notes_in_plain_words() -> None:
    with emulator("cyton", "--signal", "emg") as device, opened("cyton", device) as source:
        device.say("signal hum 2")
        device.say("signal rail 3")
        chunks_of(source, 700)
        notes = " ".join(source.info.notes)
        assert source.health is not None
        assert any("ch2: mostly 50 Hz mains" in words for words in source.health.now)
    assert "ch3: at the converter's limit" in notes
    assert "ch1" not in notes


def assert_last_heard(device: Emulator, command: bytes) -> None:
    """Wait until the command has come through the terminal, which hands bytes on in its own time."""
    until(lambda: bytes.fromhex(device.say("heard")["heard"]).endswith(command))


@pytest.mark.parametrize(("name", "stop"), [("cyton", b"s"), ("chords", b"STOP\n")])
def test_the_stream_is_off_after_every_way_out(name: str, stop: bytes) -> None:
    code = f"import sys\nfrom tega.devices import driver_class\ndriver = driver_class({name!r})\n"
    code += "driver(driver.options_type(port=sys.argv[1], measure_s=0.3)).open()\nsys.exit(3)\n"
    with emulator(name) as device:
        with opened(name, device):
            pass
        assert_last_heard(device, b"\n" + stop if name == "chords" else b"b" + stop)
        device.say("plug")
        with pytest.raises(ZeroDivisionError), opened(name, device):
            raise ZeroDivisionError
        assert_last_heard(device, stop)
        device.say("plug")
        ended = subprocess.run([sys.executable, "-c", code, device.port], check=False)
        assert ended.returncode == 3
        assert_last_heard(device, stop)


def test_a_board_left_streaming_by_a_crash_is_silenced_first() -> None:
    with emulator("cyton", "--streaming") as device, opened("cyton", device, gain=12) as source:
        chunks_of(source, 20)
        received = bytes.fromhex(device.say("heard")["heard"])
    assert received.startswith(b"svd")
    assert b"x1050100X" in received  # channel 1 on, gain 12, its own two pins, in the bias
    assert b"X45678~6" in received
    assert received.endswith(b"b")


@pytest.mark.parametrize(
    ("name", "arguments", "options", "text"),
    [
        (
            "cyton",
            "--board-off",
            {},
            "the dongle answers, the board does not: 'Failure: Communications timeout",
        ),
        (
            "cyton",
            "--firmware v1.0.0",
            {},
            r"channel 1 was not confirmed: .* \(firmware v1.0.0\) did not answer",
        ),
        ("cyton", "--fault freeze=1", {}, "nothing answers"),
        ("spiker", "--deaf", {"start_s": 1.0}, "sends 1 channels, 3 are asked for"),
        ("spiker", "--deaf --channels 2", {"start_s": 1.0}, "sends 2 channels, 3 are asked for"),
        ("spiker", "--fault freeze=1", {"start_s": 1.0}, "sends no frames of a SpikerShield"),
        ("spiker", "--fault garbage=1", {"start_s": 1.0}, "sends no frames of a SpikerShield"),
        (
            "serial-emg",
            "--baud 57600",
            {"start_s": 1.0},
            r"no valid sample for 1 s; .*check power, cable and baud",
        ),
        (
            "serial-emg",
            "--channels 2 --stamp",
            {"leading": 1, "start_s": 0.5},
            r"a line of 4 numbers was expected, the last one was '\d+,\d+,\d+'",
        ),
    ],
)
def test_a_board_that_cannot_be_used_is_refused(name, arguments, options, text):
    refused(text, name, *arguments.split(), **options)


def test_ports_that_do_not_open_say_why() -> None:
    with pytest.raises(DeviceUnavailableError, match=r"serial-emg: port /dev/ttyNone did not open"):
        SerialEmg(SerialEmgOptions(port="/dev/ttyNone", rate_hz=500.0)).open()
    with (
        emulator("serial-emg") as device,
        opened("serial-emg", device),
        pytest.raises(DeviceUnavailableError, match="another program has it open"),
    ):
        opened("serial-emg", device).open()


def test_opening_on_a_machine_that_is_never_still_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_emg, "_LOOKED_AWAY_S", 0.0)
    monkeypatch.setattr(live_emg, "_MOST_MEASURING_S", 0.1)
    refused(r"too busy for .* s to measure the sample rate", "serial-emg", start_s=0.2)


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
    assert_exact("spiker", chunks)
    assert chunks[0].samples.shape[1] == columns
    assert rate_hz == pytest.approx(2e6 / 199 / columns)
    assert set(received.splitlines()) == {f"c:{columns};".encode()}


def test_a_stamp_before_the_samples_is_dropped() -> None:
    with (
        Emulator("ascii_board", "--stamp", "--banner", "MyoWare 2.0") as device,
        opened("serial-emg", device, leading=1) as source,
    ):
        assert_exact("serial-emg", chunks_of(source, 100))


def test_an_irregular_stream_needs_its_rate_told() -> None:
    with Emulator("lsl", "--stated-rate", "0") as device:
        with pytest.raises(DeviceUnavailableError, match=r"states no sample rate; set rate_hz"):
            opened("lsl-emg", device).open()
        with opened("lsl-emg", device, rate_hz=500.0) as source:
            assert source.info.rate_hz == 500.0
