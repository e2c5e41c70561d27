"""Live vests against emulators in other processes: the contract, newest only, watchdog, faults, every way out."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.processes import until
from reference.vest_bench import OTHER, SILENT, TOUCH, Bench, bench, make
from tega.devices import driver_class
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels, vest_frame
from tega_bench.acceptance.outputs import accept_vest
from tega_bench.acceptance.report import AcceptanceGuide
from tega_emulators.vest_bench import LIVE_VESTS, seen_by

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux"),
]


V3 = {"version": "3"}
BENCHES: list[tuple[str, dict[str, Any]]] = [*((name, {}) for name in LIVE_VESTS), ("bhaptics-player", V3)]


@pytest.fixture(params=BENCHES, ids=["-".join((name, *options.values())) for name, options in BENCHES])
def any_bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    name, options = request.param
    with bench(name, **options) as made:
        yield made


def test_the_vest_on_screen(tmp_path: Path) -> None:
    terminal = tmp_path / "terminal"
    terminal.touch()
    driver: Any = driver_class("on-screen-vest", "vest")
    drawn = b"  80  60  40  20       13   0 100  53"
    with driver(driver.options_type(terminal=terminal)) as vest:
        until(lambda: vest.write(0, TOUCH) == TOUCH and drawn in terminal.read_bytes())
    with pytest.raises(DeviceUnavailableError, match="the terminal /nowhere does not open"):
        driver(driver.options_type(terminal=Path("/nowhere"))).open()


def test_a_touch_reaches_the_right_motors_and_an_open_vest_begins_silent(any_bench: Bench) -> None:
    with any_bench.vest:
        assert any_bench.shows(vest_frame([0] * 4, [0] * 4))
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        any_bench.feed(lambda: any_bench.shows(OTHER), OTHER)
        one = np.zeros(40, np.uint8)
        one[3], one[36] = 100, 47
        any_bench.feed(lambda: any_bench.shows(MotorLevels("x40", one)), MotorLevels("x40", one))
    report = seen_by(any_bench.peer)
    assert report.errors == []
    assert report.motors == SILENT
    assert not {m for m in report.modules if m.startswith(("tega.wire", "tega._native", "tega.devices"))}


def test_a_frame_that_is_not_renewed_is_silenced_by_the_watchdog(any_bench: Bench) -> None:
    with any_bench.vest as vest:
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        any_bench.wait(lambda: seen_by(any_bench.peer).motors == SILENT and vest.counters.silenced == 1)


def test_a_slow_vest_gets_the_newest_frame_and_no_queue(any_bench: Bench) -> None:
    with any_bench.vest as vest:
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        any_bench.peer.say("slow")
        for k in range(60):
            vest.write(0, vest_frame([7 * k % 100, 0, 0, 0], [0, 0, 0, 0], layout="x40"))
            time.sleep(0.02)
        received = seen_by(any_bench.peer).received
        any_bench.wait(lambda: seen_by(any_bench.peer).motors == SILENT)
        # What was on its way when writing stopped: the frame in the link, the newest one, and zeros.
        assert seen_by(any_bench.peer).received - received <= 8
        assert vest.counters.superseded >= 10
        assert vest.counters.lost == 0


def test_writing_returns_zeros_while_the_link_is_down_and_the_frame_again_afterwards(
    any_bench: Bench,
) -> None:
    broken = "close" if any_bench.port else "drop"
    with any_bench.vest as vest:
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        connections = seen_by(any_bench.peer).connections
        any_bench.peer.say(broken)
        any_bench.feed(lambda: vest.counters.lost == 1)
        any_bench.feed(lambda: not vest.write(0, TOUCH).intensities.any() or broken == "drop")
        any_bench.peer.say("clear")
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        any_bench.feed(lambda: vest.write(0, TOUCH) == TOUCH)
        report = seen_by(any_bench.peer)
        assert report.connections > connections
        assert "link was lost 1 times" in vest.info.notes[-1]
    changes = [values for _, values in report.history]
    assert SILENT in changes[1:], "a new link begins with zeros"


def test_a_frozen_peer_delays_neither_write_nor_close(any_bench: Bench) -> None:
    with any_bench.vest as vest:
        any_bench.feed(lambda: any_bench.shows(TOUCH))
        any_bench.peer.say("freeze")
        for _ in range(20):
            vest.write(0, OTHER)
            time.sleep(0.01)
        any_bench.feed(lambda: vest.counters.lost == 1, OTHER)
    any_bench.peer.say("clear")


SCANNED = {"scan_s": 0.5}
OPENING: list[tuple[str, dict[str, Any], str, str]] = [
    ("bhaptics-ble", SCANNED, "refuse", "connection-refused.*one program at a time"),
    ("bhaptics-ble", SCANNED, "off", "no vest .* was found in 0.5 s"),
    ("bhaptics-ble", SCANNED, "wrong-version", "TactSuitX40_EMU has no motor characteristic"),
    ("bhaptics-ble", SCANNED, "no-adapter", "No Bluetooth adapters found"),
    ("bhaptics-player", {}, "refuse", "answers HTTP 503"),
    ("bhaptics-player", {}, "wrong-version", "answers HTTP 404 instead of serving /v2/feedbacks"),
    ("bhaptics-player", {}, "no-vest", "has no vest connected"),
    ("bhaptics-player", {}, "freeze", "cannot be reached: timed out"),
    ("hid-vest", {}, "close", "no USB board 1209:0001 is there"),
    ("hid-vest", {}, "refuse", "does not open: open failed; .*udev rule"),
    ("hid-vest", {}, "wrong-version", "format version is 0x2, 0x1 is needed"),
    ("hid-vest", {}, "garbage", "no status in report format version 1: .*checksum"),
    ("hid-vest", {}, "freeze", "no status in report format version 1"),
    ("hid-vest", {}, "no-vest", "the USB board 1209:0001 has no vest connected"),
    ("bhaptics-player", V3, "refuse", "answers HTTP 503 instead of serving /v3/feedback"),
    ("bhaptics-player", V3, "wrong-version", "HTTP 404 instead of serving /v3/feedback.*developer portal"),
    ("bhaptics-player", V3, "no-vest", "has no vest connected"),
    ("bhaptics-player", V3, "no-entry", "not let this program in within 2 s; are app_id and the key"),
    ("bhaptics-player", V3, "freeze", "cannot be reached: timed out"),
]


@pytest.mark.parametrize(("name", "options", "fault", "message"), OPENING)
def test_opening_says_what_is_wrong_and_never_the_key(
    name: str, options: dict[str, Any], fault: str, message: str
) -> None:
    # Who never answers is waited for in vain, and every other one answers in its own time.
    with bench(name, open_timeout_s=1.0 if fault == "freeze" else 4.0, **options) as made:
        made.peer.say(fault)
        if made.port is not None:
            made.port.can_open = fault != "refuse"
        with pytest.raises(DeviceUnavailableError, match=message) as reported:
            made.vest.open()
        assert "not-a-real-key" not in str(reported.value)
        with pytest.raises(DeviceUnavailableError, match="is not open"):
            made.vest.write(0, TOUCH)


def test_a_vest_that_a_dead_program_left_connected_is_found_and_silenced() -> None:
    with bench("bhaptics-ble") as made:
        made.peer.say("held")
        with made.vest:
            made.feed(lambda: made.shows(TOUCH))
        assert seen_by(made.peer).motors == SILENT
        made.peer.say("held")
        with pytest.raises(DeviceUnavailableError, match="no vest with the address 00:11"):
            make("bhaptics-ble", scan_s=0.3, address="00:11").open()


@pytest.mark.parametrize("fault", ["off", "freeze"])
def test_a_vest_that_takes_no_zeros_is_not_left_alone(fault: str, caplog: pytest.LogCaptureFixture) -> None:
    with bench("bhaptics-ble") as made:
        with made.vest:
            made.feed(lambda: made.shows(TOUCH))
            made.peer.say(fault)
        assert seen_by(made.peer).motors != SILENT
        assert not made.vest.confirmed_rest  # type: ignore[attr-defined]
        assert "USE THE VEST'S SWITCH: C0:FF:EE:00:40:01" in caplog.text
        made.peer.say("clear")
        made.wait(lambda: seen_by(made.peer).motors == SILENT)


def test_a_vest_whose_link_comes_back_is_guarded_by_the_same_process(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with bench("bhaptics-ble") as made:
        with made.vest as vest:
            made.feed(lambda: made.shows(TOUCH))
            guard = vest._watch.guard  # type: ignore[attr-defined]
            made.peer.say("drop")
            made.feed(lambda: vest.counters.lost == 1)
            made.peer.say("clear")
            made.feed(lambda: vest.reached and made.shows(OTHER), OTHER)
            assert vest._watch.guard is guard  # type: ignore[attr-defined]
            assert guard._process.poll() is None
        assert seen_by(made.peer).motors == SILENT
        assert guard._process.poll() == 0
        assert "SWITCH" not in caplog.text


def test_an_acceptance_says_of_closing_what_the_vest_confirmed() -> None:
    with bench("bhaptics-ble", limit=20) as made:
        made.vest.open()
        *_, stop = accept_vest(made.vest, "x40", 20, AcceptanceGuide(yes=True))
    assert stop.name == "stop"
    assert "and the vest has answered behind the zeros of closing" in stop.said


def test_a_bluetooth_vest_at_rest_is_left_to_its_driver() -> None:
    with bench("bhaptics-ble") as made, made.vest as vest:
        guard = vest._watch.guard  # type: ignore[attr-defined]
        connections, sent = seen_by(made.peer).connections, vest.counters.sent
        made.wait(lambda: vest.counters.sent >= sent + 3)  # a second each
        assert vest.counters.lost == 0
        assert guard.n_lost == 0
        assert seen_by(made.peer).connections == connections


def test_a_bluetooth_vest_that_was_silenced_in_a_standstill_is_felt_again() -> None:
    with bench("bhaptics-ble") as made:
        words = [sys.executable, "-c", PROGRAM, "bhaptics-ble", "wait", "{}"]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
            try:
                made.wait(lambda: made.shows(TOUCH))
                program.send_signal(signal.SIGSTOP)
                made.wait(lambda: seen_by(made.peer).motors == SILENT)
                program.send_signal(signal.SIGCONT)
                made.wait(lambda: made.shows(TOUCH))
            finally:
                program.send_signal(signal.SIGCONT)  # a stopped program would not hear of its end
                program.terminate()
                program.communicate()
        made.wait(lambda: seen_by(made.peer).motors == SILENT)


def test_nobody_at_the_other_end_is_a_missing_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "key").write_text("k")
    both = make("bhaptics-player", port=9, port_v3=9, app_id="a", api_key_file=tmp_path / "key")
    with pytest.raises(
        DeviceUnavailableError, match=r"cannot be reached: .*; version 3: .*cannot be reached"
    ):
        both.open()
    with pytest.raises(DeviceUnavailableError, match=r"cannot be reached.*start the bHaptics Player"):
        make("bhaptics-player", port=9).open()
    with pytest.raises(DeviceUnavailableError, match=r"no USB board 1209:0001, serial number X is there"):
        make("hid-vest", serial="X").open()  # the real hidapi, which finds no such board
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere/bus")
    with pytest.raises(DeviceUnavailableError, match=r"service cannot be reached.*systemctl start bluetooth"):
        make("bhaptics-ble").open()


PROGRAM = """
import sys, time
from tega.config import check_tree
from tega.devices import driver_class
from tega.haptics import vest_frame
name, how, options = sys.argv[1], sys.argv[2], eval(sys.argv[3])
if name == "hid-vest":
    from tega_emulators.hid_port import HidPort
    installed = HidPort(options.pop("path")).installed()
    installed.__enter__()
driver = driver_class(name, "vest")
if "api_key_file" in options:
    from pathlib import Path
    options["api_key_file"] = Path(options["api_key_file"])
vest = driver(driver.options_type(**options))
vest.open()
print("open", flush=True)
def touch():
    for _ in range(20 if how != "wait" else 100000):
        vest.write(0, vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40"))
        time.sleep(0.02)
if how == "exception":
    with vest:
        touch()
        raise RuntimeError("on purpose")
touch()
"""


@pytest.mark.parametrize("how", ["forgotten", "exception", "SIGTERM", "SIGKILL", "SIGSTOP"])
def test_every_way_out_of_a_program_leaves_the_vest_silent(any_bench: Bench, how: str) -> None:
    made = any_bench
    vest: Any = made.vest
    options: dict[str, Any] = {"bhaptics-ble": {}, "hid-vest": {"path": made.peer.address.get("path")}}.get(
        vest.name, {}
    )
    if vest.name == "bhaptics-player":
        o = vest._options
        options = {"version": o.version, "app_id": o.app_id, **made.peer.address}
        if o.api_key_file is not None:
            options["api_key_file"] = str(o.api_key_file)
    mode = how if how in {"forgotten", "exception"} else "wait"
    words = [sys.executable, "-c", PROGRAM, vest.name, mode, repr(options)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        made.wait(lambda: made.shows(TOUCH))
        if mode == "wait":
            program.send_signal(getattr(signal, how))
        if how == "SIGSTOP":
            made.wait(lambda: seen_by(made.peer).motors == SILENT)
            program.kill()
        _, message = program.communicate()
    codes = {"forgotten": 0, "exception": 1, "SIGTERM": 143, "SIGKILL": -9, "SIGSTOP": -9}
    assert program.returncode == codes[how], message
    made.wait(lambda: seen_by(made.peer).motors == SILENT)
