"""The live EMG drivers against their emulators: exact samples, and every fault with its outcome."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.devices.base import EmgChunk
from tega.devices.emg import live_emg
from tega.devices.emg.chords import Chords, ChordsOptions
from tega.devices.emg.cyton import Cyton, CytonOptions
from tega.devices.emg.live_emg import LiveEmg
from tega.devices.emg.lsl_emg import LslEmg, LslEmgOptions
from tega.devices.emg.serial_emg import SerialEmg, SerialEmgOptions
from tega.devices.emg.spiker import Spiker, SpikerOptions
from tega.errors import DeviceUnavailableError, MissingExtraError, SampleRateError
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow

# Nothing here waits that long unless it fails.
PATIENCE_S = 60.0
QUICK = {"measure_s": 0.25, "silence_s": 20.0, "start_s": 10.0}
CYTON_STEP_UV = 100 * 4.5e6 / 24 / (2**23 - 1)


class Case(NamedTuple):
    emulator: str
    arguments: tuple[str, ...]
    make: Callable[..., LiveEmg]
    steps: Callable[[NDArray[np.float64]], NDArray[np.float64]]


CASES = {
    "serial-emg": Case(
        "ascii_board",
        ("--rate", "500"),
        lambda port, **o: SerialEmg(
            SerialEmgOptions(**({"port": port, "rate_hz": 500.0, "bits": 10} | QUICK | o))
        ),
        lambda samples: samples - 512,
    ),
    "cyton": Case(
        "cyton",
        (),
        lambda port, **o: Cyton(CytonOptions(**({"port": port} | QUICK | o))),
        lambda samples: samples / CYTON_STEP_UV,
    ),
    "chords": Case(
        "chords",
        (),
        lambda port, **o: Chords(ChordsOptions(**({"port": port} | QUICK | o))),
        lambda samples: samples - 2048,
    ),
    "spiker": Case(
        "spiker",
        (),
        lambda port, **o: Spiker(SpikerOptions(**({"port": port} | QUICK | o))),
        lambda samples: samples - 512,
    ),
    "lsl-emg": Case(
        "lsl",
        (),
        lambda port, **o: LslEmg(LslEmgOptions(**({"by": "source_id", "value": port} | QUICK | o))),
        lambda samples: samples,
    ),
}
COUNTED = ("cyton", "chords")
TRANSPORTS = (
    "cyton",
    "lsl-emg",
)  # silence and loss are told by the port or the network, whatever the board is


def emulator(name: str, *arguments: str) -> Emulator:
    return Emulator(CASES[name].emulator, *CASES[name].arguments, *arguments)


def opened(name: str, device: Emulator, **options: Any) -> LiveEmg:
    return CASES[name].make(device.port, **options)


def chunks_of(source: LiveEmg, n_samples: int) -> list[EmgChunk]:
    chunks, n, deadline = [], 0, time.monotonic() + PATIENCE_S
    while n < n_samples:
        assert time.monotonic() < deadline, f"{n} samples after {PATIENCE_S} s"
        chunk = source.read(0.1)
        if chunk is not None:
            chunks.append(chunk)
            n += len(chunk.samples)
    return chunks


def error_of(source: LiveEmg) -> DeviceUnavailableError:
    """Read until it raises."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            source.read(0.1)
        except DeviceUnavailableError as error:
            return error
    raise AssertionError(f"still alive after {PATIENCE_S} s")


def phases(name: str, chunks: list[EmgChunk]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return by how much each row of the ramp is off its index, modulo 1000, and which rows are whole."""
    index = np.concatenate([c.first_index + np.arange(len(c.samples)) for c in chunks])
    steps = CASES[name].steps(np.concatenate([c.samples for c in chunks]))
    whole = np.rint(steps).astype(np.int64)
    if name == "serial-emg":
        # Ten bits end at 1023: what would be above is cut off.
        assert whole.max() <= 511
    exact = (np.abs(steps - whole) < 1e-6).all(axis=1)
    rows = (whole[:, [0]] + 500 + 100 * np.arange(whole.shape[1])) % 1000 - 500
    exact &= (rows == whole).all(axis=1)
    return (whole[:, 0] + 500 - index) % 1000, exact


@pytest.mark.parametrize("name", sorted(CASES))
def test_samples_are_exact_and_none_is_lost(name: str) -> None:
    n_samples = 3000 if name == "spiker" else 250  # about a second of each
    with emulator(name) as device, opened(name, device) as source:
        chunks = chunks_of(source, n_samples)
        assert source.info.label not in {"", device.port if name != "lsl-emg" else ""}
        assert source.measured_hz == pytest.approx(source.info.rate_hz, rel=0.1)
    phase, exact = phases(name, chunks)
    assert exact.all()
    assert (phase == phase[0]).all()
    assert chunks[0].first_index == 0
    assert all(0 < chunk.t_ns <= time.monotonic_ns() for chunk in chunks)
    # The channels that were not asked for are not in it.
    assert chunks[0].samples.shape[1] == 3


@pytest.mark.parametrize("name", ["cyton", "serial-emg"])
def test_what_waited_before_the_first_read_is_neither_delivered_nor_called_lost(name: str) -> None:
    with emulator(name) as device, opened(name, device) as source:
        time.sleep(1.5)  # three times what a port's buffer holds of a Cyton
        called_ns = time.monotonic_ns()
        chunks = chunks_of(source, 100)
        assert not [note for note in source.info.notes if "lost" in note]
    phase, exact = phases(name, chunks)
    assert exact.all()
    assert (phase == phase[0]).all()
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


@pytest.mark.parametrize("name", COUNTED)
def test_a_board_that_restarts_under_an_open_port_stops_and_starts_when_opened_again(name: str) -> None:
    with emulator(name) as device, opened(name, device, silence_s=1.0) as source:
        chunks_of(source, 20)
        device.say("reset")
        assert "sent no valid sample" in error_of(source).message
        source.open()
        assert len(chunks_of(source, 20))


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


def test_a_source_that_becomes_slow_is_given_up() -> None:
    with emulator("serial-emg") as device, opened("serial-emg", device) as source:
        device.say("slow 0.3")
        error = error_of(source)
    assert isinstance(error, SampleRateError)
    assert "500 were expected" in error.message or "needs 125" in error.message


def test_a_board_that_says_itself_that_it_is_too_slow_is_not_measured() -> None:
    with emulator("serial-emg") as device:
        source = opened("serial-emg", device, rate_hz=20.0)
        with pytest.raises(SampleRateError, match="is said to send 20 samples/s; the 50 Hz filter needs 125"):
            source.open()


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
    deadline = time.monotonic() + PATIENCE_S
    while not (received := bytes.fromhex(device.say("heard")["heard"])).endswith(command):
        assert time.monotonic() < deadline, received
        time.sleep(0.01)


@pytest.mark.parametrize(("name", "stop"), [("cyton", b"s"), ("chords", b"STOP\n")])
def test_the_stream_is_off_after_every_way_out(name: str, stop: bytes) -> None:
    code = (
        "import sys\n"
        f"from tega.devices import driver_class\n"
        f"driver = driver_class({name!r})\n"
        "source = driver(driver.options_type(port=sys.argv[1], measure_s=0.3))\n"
        "source.open()\n"
        "sys.exit(3)\n"
    )
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
    ("arguments", "text"),
    [
        (("--board-off",), "the dongle answers, the board does not: 'Failure: Communications timeout"),
        (
            ("--firmware", "v1.0.0"),
            r"channel 1 was not confirmed: the board \(firmware v1.0.0\) did not answer",
        ),
        (("--fault", "freeze=1"), "nothing answers"),
    ],
)
def test_a_cyton_that_cannot_be_set_up_is_refused(arguments: tuple[str, ...], text: str) -> None:
    with emulator("cyton", *arguments) as device, pytest.raises(DeviceUnavailableError, match=text):
        opened("cyton", device).open()


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


@pytest.mark.parametrize("arguments", [("--generation", "2024"), ("--generation", "2026")], ids=" ".join)
def test_chords_boards_of_both_generations_are_found_at_either_speed(arguments: tuple[str, ...]) -> None:
    # As the sketches of UNO clones: 115200 baud is the second that is tried.
    board = ("--name", "UNO-CLONE", "--rate", "250", "--bits", "10", "--channels", "6", "--baud", "115200")
    with emulator("chords", *arguments, *board) as device:
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
    with emulator("spiker", *arguments) as device, pytest.raises(DeviceUnavailableError, match=text):
        opened("spiker", device, start_s=1.0).open()


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
    with (
        Emulator("ascii_board", "--channels", "2", "--stamp") as device,
        pytest.raises(
            DeviceUnavailableError, match=r"a line of 4 numbers was expected, the last one was '\d+,\d+,\d+'"
        ),
    ):
        opened("serial-emg", device, leading=1, start_s=0.5).open()


def test_a_stamp_before_the_samples_is_dropped() -> None:
    with (
        Emulator("ascii_board", "--stamp", "--banner", "MyoWare 2.0") as device,
        opened("serial-emg", device, leading=1) as source,
    ):
        phase, exact = phases("serial-emg", chunks_of(source, 100))
    assert exact.all()
    assert (phase == phase[0]).all()


def test_a_wrong_baud_rate_is_suspected() -> None:
    with emulator("serial-emg", "--baud", "57600") as device:
        source = opened("serial-emg", device, start_s=1.0)
        with pytest.raises(
            DeviceUnavailableError, match=r"no valid sample for 1 s; .*check power, cable and baud"
        ):
            source.open()


def test_ports_that_do_not_open_say_why() -> None:
    with pytest.raises(DeviceUnavailableError, match=r"serial-emg: port /dev/ttyNone did not open"):
        SerialEmg(SerialEmgOptions(port="/dev/ttyNone", rate_hz=500.0)).open()
    with (
        emulator("serial-emg") as device,
        opened("serial-emg", device),
        pytest.raises(DeviceUnavailableError, match="another program has it open"),
    ):
        opened("serial-emg", device).open()


def test_a_stream_that_is_not_on_the_network() -> None:
    source = LslEmg(LslEmgOptions(value="tega-nobody", start_s=0.3))
    with pytest.raises(DeviceUnavailableError, match=r"no stream with name 'tega-nobody' on the network"):
        source.open()


def test_an_irregular_stream_needs_its_rate_told() -> None:
    with Emulator("lsl", "--stated-rate", "0") as device:
        with pytest.raises(DeviceUnavailableError, match=r"states no sample rate; set rate_hz"):
            opened("lsl-emg", device).open()
        with opened("lsl-emg", device, rate_hz=500.0) as source:
            assert source.info.rate_hz == 500.0


@pytest.mark.parametrize(("name", "module"), [("cyton", "serial"), ("lsl-emg", "pylsl")])
def test_a_missing_package_names_the_extra(name: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"pip install 'tega\[(lab|lsl)\]'"):
        CASES[name].make("nowhere").open()


def test_opening_on_a_machine_that_is_never_still_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_emg, "_LOOKED_AWAY_S", 0.0)
    monkeypatch.setattr(live_emg, "_MOST_MEASURING_S", 0.1)
    with Emulator("ascii_board", "--rate", "500") as board:
        options = SerialEmgOptions(port=board.port, rate_hz=500.0, bits=10, measure_s=0.25, start_s=0.2)
        with pytest.raises(DeviceUnavailableError, match=r"too busy for .* s to measure the sample rate"):
            SerialEmg(options).open()
