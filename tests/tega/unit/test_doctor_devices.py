"""The doctor: what it says of devices that are broken in known ways, and of what the operator holds or steps on."""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from string import Template

import numpy as np
import pytest

from reference.command import call
from reference.processes import until
from tega.config import load_config
from tega.devices.fingertip.video_nodes import VideoNode
from tega.devices.vest.vest_ble import BleVest
from tega.devices.vest.vest_hid import HidVest
from tega.setup.doctor import Finding, examine, lab_settings
from tega.setup.doctor.bench import ROLES, probe_all
from tega.setup.doctor.sensors import FoundCamera, crowded
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

DIGIT = '[tactile.thumb]\ndriver = "digit"\noptions = { source = "$source" }\n'
PLAYER = '[vest]\ndriver = "bhaptics-player"\noptions = { port = $port }\n'
BOARD = '[emg]\ndriver = "serial-emg"\nkind = "raw"\noptions = { port = "$port", rate_hz = 500, measure_s = 0.25 }\n'
HAND = (
    '[hand]\ndriver = "allegro"\n'
    'options = { interface = "slcan", channel = "$channel", bus = { sleep_after_open = 0.0 } }\n'
)
CAP, FOOT = (0x046D, 0xC626), (0x0C45, 0x7403)
INPUTS = """
[input.motion]
driver = "spacemouse"
[input.dead_man]
driver = "pedal"
options = { silent_after_ms = 10000 }
[input.marker]
driver = "spacemouse"
button = "right"
"""
slow = pytest.mark.slow


def reported(tmp_path: Path, settings: str) -> list[Finding]:
    path = tmp_path / "lab.toml"
    path.write_text(settings)
    findings = examine(load_config(path, environ={}).config, name=path.name).findings
    # The calibration, and settings without input, have tests of their own; here it is about devices.
    return [f for f in findings if f.check not in {"calibration", "settings"}]


def only(tmp_path: Path, settings: str) -> Finding:
    (finding,) = reported(tmp_path, settings)
    return finding


@pytest.mark.parametrize(
    ("words", "said", "settings", "status", "finding", "todo"),
    [
        pytest.param(
            ("allegro_port", "--hardware", "0x0500"), "look", HAND, "error", "version 5.0", "", marks=slow
        ),
        pytest.param(
            ("ascii_board", "--fault", "slow=0.2"), "", BOARD, "error", "samples/s", "delay()", marks=slow
        ),
        pytest.param(("digit",), "black", DIGIT, "error", "black", "", marks=slow),
        pytest.param(("digit",), "cut", DIGIT, "missing", "does not open", "", marks=slow),
        (("bhaptics_player", "--port", "0"), "no-vest", PLAYER, "missing", "has no vest connected", ""),
    ],
)
def test_a_device_in_trouble(
    tmp_path: Path, words: tuple[str, ...], said: str, settings: str, status: str, finding: str, todo: str
) -> None:
    with Emulator(*words) as device:
        if said:
            device.say(said)
        found = only(tmp_path, Template(settings).substitute(device.address))
        assert words[0] != "allegro_port" or not device.say("look")["servo_on"]
    assert found.status == status
    assert finding in found.finding
    assert not todo or any(todo in step for step in found.todo)


@pytest.mark.slow
def test_an_amplifier_that_hums(tmp_path: Path) -> None:
    with Emulator("cyton", "--signal", "hum") as board:
        options = f'options = {{ port = "{board.port}", measure_s = 0.3 }}'
        found = reported(tmp_path, f'[emg]\ndriver = "cyton"\nkind = "raw"\n{options}\n')
    assert {f.status for f in found} <= {"ok", "warning"}
    assert any("50 Hz mains" in f.finding for f in found if f.status == "warning")


def test_a_vest_behind_version_3_tells_name_link_and_battery(tmp_path: Path) -> None:
    (tmp_path / "key.txt").write_text("k")
    with Emulator("bhaptics_player", "--port", "0", "--port-v3", "0") as player:
        ports = f"port = {player.address['port']}, port_v3 = {player.address['port_v3']}"
        more = 'app_id = "lab", api_key_file = "key.txt"'
        settings = f'[vest]\ndriver = "bhaptics-player"\noptions = {{ {ports}, {more} }}\n'
        well = only(tmp_path, settings)
        player.say("flat")
        findings = reported(tmp_path, settings)
        assert seen_by(player).errors == []
    assert well.status == "ok"
    assert "(TactSuitX40 connected, Player version 3, battery 98 %, fit unknown)" in well.finding
    assert well.measured == {"battery_percent": 98.0}
    assert "--only vest" in well.todo[0]
    assert [(f.status, f.finding) for f in findings if f.check == "vest"][1:] == [
        ("warning", "the vest's battery is at 9 %")
    ]
    gone = only(tmp_path, settings)
    assert gone.status == "missing"
    assert "cannot be reached" in gone.finding
    assert "start the bHaptics Player" in gone.todo[0]


@pytest.mark.slow
def test_a_camera_slower_than_agreed_and_a_baseline_of_another_size(tmp_path: Path) -> None:
    np.save(tmp_path / "gel.npy", np.zeros((240, 320, 3), np.uint8))
    with Emulator("digit", "--rate-hz", "15") as camera:
        settings = Template(DIGIT).substitute(camera.address) + 'baseline = "gel.npy"\n'
        rate, baseline = reported(tmp_path, settings)
    assert "where 60 were agreed" in rate.finding
    assert baseline.status == "error"
    assert "gel.npy is 320×240" in baseline.finding


def test_a_package_that_is_not_installed_and_a_can_bus_that_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    board = '[emg]\ndriver = "cyton"\nkind = "raw"\noptions = { port = "/dev/ttyUSB9" }\n'
    finding = only(tmp_path, board)
    assert finding.status == "missing"
    assert finding.todo == ("install it with: pip install 'tega[lab]'",)
    hand = '[hand]\ndriver = "allegro"\noptions = { interface = "socketcan", channel = "can77" }\n'
    assert "no CAN bus 'can77'" in only(tmp_path, hand).finding


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("overheated", "error: the hand reports a temperature fault: a run lets go of it at once"),
        (
            "hot",
            "warning: its torque is limited to 50 %: a joint is at 85 °C; error: a joint is at 80 °C or more",
        ),
        ("drop", "warning: positions of a finger are missing"),
    ],
)
def test_a_hand_that_a_run_would_let_go_of_or_warn_of(tmp_path: Path, fault: str, expected: str) -> None:
    with Emulator("allegro_port") as hand:
        hand.say(fault)
        options = f'interface = "slcan", channel = "{hand.address["channel"]}", lowest_rate_hz = 0.0'
        found = reported(tmp_path, f'[hand]\ndriver = "allegro"\noptions = {{ {options} }}\n')
    assert expected in "; ".join(f"{one.status}: {one.finding}" for one in found)


def test_what_would_overwrite_a_recording_is_not_opened(tmp_path: Path) -> None:
    table = tmp_path / "vest.csv"
    table.write_text("kept")
    found = reported(
        tmp_path,
        '[vest]\ndriver = "vest-recorder"\noptions = { file = "vest.csv" }\n'
        '[hand]\ndriver = "can-recorder"\noptions = { file = "can.csv" }\n',
    )
    assert table.read_text() == "kept"
    assert found[0].status == "ok"
    assert "needs no device" in found[0].finding


def test_four_sensors_on_one_bus_are_too_many() -> None:
    def bench_of(rate_hz: float, buses: str) -> list[Finding]:
        cameras = [FoundCamera("tactile", f"D{n}", rate_hz, 320 * 240) for n in range(4)]
        nodes = [
            VideoNode(f"/dev/video{n}", "DIGIT", f"D{n}", 0x0200, "2833:0209", bus)
            for n, bus in enumerate(buses)
        ]
        return crowded(cameras, nodes)

    (finding,) = bench_of(60.0, "1111")
    assert "4 sensors share USB bus 1 and send 37 MB/s" in finding.finding
    assert bench_of(60.0, "1122") == []
    assert bench_of(30.0, "1111") == []


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("dbus-daemon") is None, reason="dbus-daemon is not installed")
def test_a_vest_over_bluetooth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Emulator("bluez_vest") as vest:
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", vest.address["bus"])
        (found,) = BleVest.discover(3.0)
        assert found.label.startswith(("TactSuit", "Tactot"))
        assert not found.may_open
        (seen,) = [f for f in probe_all().findings if f.check == "vest"]
        assert found.label in seen.finding
        options = f'options = {{ scan_s = 1.0, address = "{found.options["address"]}" }}'
        assert only(tmp_path, f'[vest]\ndriver = "bhaptics-ble"\n{options}\n').status == "ok"
        assert not any(any(motors) for _, motors in seen_by(vest).history)


def test_a_vest_board_that_may_not_be_opened(tmp_path: Path) -> None:
    with Emulator("hid_bridge", str(tmp_path)) as vest:
        port = HidPort(vest.address["path"])
        with port.installed():
            assert [found.options for found in HidVest.discover(1.0)] == [{"serial": "EMULATED"}]
            settings = '[vest]\ndriver = "hid-vest"\n'
            assert only(tmp_path, settings).status == "ok"
            port.can_open = False
            finding = only(tmp_path, settings)
    assert "does not open" in finding.finding
    assert any("udev rule" in step for step in finding.todo)


@contextmanager
def attached() -> Iterator[tuple[Emulator, Emulator, HidPort]]:
    with (
        Emulator("hid_input", "--device", "spacemouse") as cap,
        Emulator("hid_input", "--device", "pedal-keyboard") as foot,
    ):
        port = HidPort(HidBoard(cap.port, *CAP), HidBoard(foot.port, *FOOT))
        with port.installed():
            yield cap, foot, port


@contextmanager
def once_open(port: HidPort, device: Emulator, subject: str, *, seats: int = 1) -> Iterator[None]:
    """Have a device do something as soon as all seats it is for have it open in the block."""
    before = port.n_opened[device.port]

    def act() -> None:
        until(lambda: port.n_opened[device.port] >= before + seats)
        device.say(subject)

    thread = threading.Thread(target=act)
    thread.start()
    yield
    thread.join()


@pytest.mark.slow
def test_every_seat_is_examined_and_what_is_wrong_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with attached() as (cap, foot, port):
        found = reported(tmp_path, INPUTS)
        assert [f.check for f in found] == ["input.motion", "input.dead_man", "input.marker"]
        assert {f.status for f in found} == {"ok"}
        assert "spacemouse SpaceNavigator is open and at rest" in found[0].finding
        # The inputs are ready, and `run` needs more than them.
        out, _ = call(capsys, "doctor", tmp_path / "lab.toml", code=3)
        assert "he settings name no input" in out

        cap.say("push 0 -350 0 0 0 0")
        # A pedal tells of changes only, so the foot comes down while somebody listens.
        with once_open(port, foot, "press 0"):
            motion, dead_man, _ = reported(tmp_path, INPUTS)
        assert motion.status == "warning"
        assert "the cap is pushed or turned" in motion.finding
        assert "touched: " in dead_man.finding
        assert "is down" in dead_man.finding
        cap.say("push 0 0 0 0 0 0")
        foot.say("lift 0")

        with once_open(port, cap, "unplug", seats=2):
            found = reported(tmp_path, INPUTS)
        assert [f.status for f in found] == ["error", "ok", "error"]
        assert "opened, and then had no data" in found[0].finding
        motion, *_ = reported(tmp_path, INPUTS)
        assert motion.status == "missing"
        assert motion.todo
        port.can_open = False
        _, dead_man, _ = reported(tmp_path, INPUTS)
        assert dead_man.status == "error"
        assert "does not open" in dead_man.finding
        assert any("udev rule" in step for step in dead_man.todo)


def test_init_writes_them_and_a_look_around_stays_with_the_four_devices(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "lab.toml"
    with attached():
        assert {f.check for f in probe_all().findings} <= {"packages", *ROLES}
        call(capsys, "init", "--out", out)
        config = load_config(out, environ={}).config
    assert {seat: c.driver for seat, c in config.input.in_use().items()} == {
        "motion": "spacemouse",
        "dead_man": "pedal",
    }
    assert config.input.motion is not None
    assert (config.input.motion.options.vendor_id, config.input.motion.options.product_id) == CAP
    out.write_text(lab_settings({}, name=out.name))
    assert not load_config(out, environ={}).config.input.in_use()
    assert "# [input.motion]" in out.read_text()
    # Switched on as it stands, each comment is a table that can be read.
    text = out.read_text()
    lines = text[text.index("# [input.motion]") :].splitlines()
    out.write_text("\n".join(line.removeprefix("# ") for line in lines))
    seats = ["motion", "dead_man", "clutch", "recover"]
    assert list(load_config(out, environ={}).config.input.in_use()) == seats
