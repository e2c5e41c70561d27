"""The doctor: what it says of benches that are empty, whole, and broken in known ways."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tega.cli.main import main
from tega.config import load_config
from tega.doctor import Examination, Finding, examine, look_for
from tega.doctor.bench import LOOK_S, ROLES, TRY_S, Looked, look_around, try_all
from tega.doctor.case import Case, holders
from tega.doctor.in_time import in_time
from tega.doctor.tactile import Camera, crowded
from tega.testing.emulated_bench import EmulatedBench
from tega.testing.emulators.process import Emulator
from tega.testing.emulators.vests import seen_by

FINDING_KEYS = {"check", "status", "finding", "why", "todo", "driver", "device", "measured"}


def call(capsys: pytest.CaptureFixture[str], *words: object, code: int) -> tuple[str, str]:
    with pytest.raises(SystemExit) as ended:
        main([str(w) for w in words])
    captured = capsys.readouterr()
    assert ended.value.code == code, captured
    return captured.out, captured.err


def told(tmp_path: Path, settings: str) -> Examination:
    path = tmp_path / "lab.toml"
    path.write_text(settings)
    examination = examine(load_config(path, environ={}).config, name=path.name)
    # The calibration has tests of its own; here it is about devices.
    devices = tuple(f for f in examination.findings if f.check != "calibration")
    return Examination(settings=examination.settings, findings=devices)


def only(examination: Examination) -> Finding:
    (finding,) = examination.findings
    return finding


# An empty bench.


def test_looking_around_ends_within_ten_seconds_whatever_hangs() -> None:
    assert LOOK_S + TRY_S <= 9.5  # half a second is left for starting and printing
    never = threading.Event()
    answers = in_time({"hangs": never.wait, "answers": lambda: True}, 0.05, lambda key, s: f"{key} {s:g}")
    assert answers == {"hangs": "hangs 0.05", "answers": True}
    never.set()


def doctor_alone(folder: Path, *words: str) -> tuple[int, str, str]:
    """Run it as a program that hears no stream of another program on this network, and return what it said."""
    alone = folder / "lsl_api.cfg"
    alone.write_text(f"[lab]\nSessionID = {folder.name}\n[log]\nlevel = -2\n")
    ran = subprocess.run(
        [sys.executable, "-m", "tega.cli", "doctor", *words],
        env={**os.environ, "LSLAPICFG": str(alone)},
        capture_output=True,
        text=True,
        check=False,
    )
    return ran.returncode, ran.stdout, ran.stderr


def test_an_empty_bench_is_told_kindly_and_ends_with_3(tmp_path: Path) -> None:
    code, out, _ = doctor_alone(tmp_path, "--json")
    said = json.loads(out)
    if any(f["device"] for f in said["findings"]):
        pytest.skip("something is attached to this machine")
    assert set(said) == {"format", "version", "settings", "ok", "exit_code", "findings"}
    assert (said["format"], said["version"], said["settings"]) == ("tega-doctor", 1, None)
    assert (said["ok"], said["exit_code"], code) == (False, 3, 3)
    assert [f["check"] for f in said["findings"]] == list(ROLES)
    for finding in said["findings"]:
        assert set(finding) == FINDING_KEYS
        assert finding["status"] == "missing"
        assert finding["finding"]
        assert finding["why"]
        assert finding["todo"]
    code, out, err = doctor_alone(tmp_path)
    assert code == 3
    assert "up to 10 s" in err
    assert "No DIGIT is plugged in" in out
    # A command stands on a line of its own, whole.
    command = "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100"
    assert command in [line.strip() for line in out.splitlines()]
    assert "tega-teleop demo" in out


def test_every_driver_with_hardware_can_say_what_is_there() -> None:
    assert set(look_for()) >= {
        "allegro",
        "bhaptics-ble",
        "bhaptics-player",
        "cyton",
        "digit",
        "hid-vest",
        "lsl-emg",
    }


# A whole one.


@pytest.fixture(scope="module")
def bench() -> Iterator[EmulatedBench]:
    with EmulatedBench() as up:
        yield up


def test_a_bench_with_every_emulator_up_is_fine(
    bench: EmulatedBench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "lab.toml"
    bench.write_settings(settings)
    out, _ = call(capsys, "doctor", settings, "--json", code=0)
    said = json.loads(out)
    assert {f["status"] for f in said["findings"]} <= {"fine", "doubt"}
    assert {f["check"] for f in said["findings"] if f["status"] == "fine"} >= {"emg", "vest", "hand"}
    assert said["settings"] == "lab.toml"
    emg = next(f for f in said["findings"] if f["check"] == "emg")
    assert emg["measured"]["rate_hz"] > 0
    # Nothing was felt, and nothing moved.
    assert not any(any(motors) for _, motors in seen_by(bench.player).history)
    hand = bench.hand.say("look")
    assert not hand["servo_on"]
    assert not any(hand["duties"])


def test_init_of_an_emulated_bench_is_a_run_that_can_start(bench: EmulatedBench, tmp_path: Path) -> None:
    from tega.calibration import load_calibration

    settings = tmp_path / "lab.toml"
    bench.write_settings(settings)
    config = load_config(settings, environ={}).config
    assert list(config.tactile.in_use()) == ["thumb", "index"]
    assert all(c.baseline is not None and c.baseline.is_file() for c in config.tactile.in_use().values())
    assert config.calibration.file is not None
    assert load_calibration(config.calibration.file).origin == "made up for the emulated devices"


# Broken ones.


def test_a_hand_of_another_version(tmp_path: Path) -> None:
    with Emulator("allegro_port", "--hardware", "0x0500") as hand:
        options = json.dumps({"interface": "slcan", "channel": hand.address["channel"]})
        case = '[hand]\ndriver = "allegro"\n[hand.options]\n' + "".join(
            f"{key} = {json.dumps(value)}\n" for key, value in json.loads(options).items()
        )
        finding = only(told(tmp_path, case + "bus = { sleep_after_open = 0.0 }\n"))
        assert not hand.say("look")["servo_on"]
    assert finding.status == "wrong"
    assert "version 5.0" in finding.finding
    assert finding.todo


def test_an_amplifier_that_is_too_slow(tmp_path: Path) -> None:
    with Emulator("ascii_board", "--rate", "500", "--fault", "slow=0.2") as board:
        finding = only(
            told(
                tmp_path,
                f'[emg]\ndriver = "serial-emg"\nkind = "raw"\n'
                f'options = {{ port = "{board.port}", rate_hz = 500, measure_s = 0.25 }}\n',
            )
        )
    assert finding.status == "wrong"
    assert "samples/s" in finding.finding
    assert any("delay()" in step for step in finding.todo)


def test_an_amplifier_that_hums(tmp_path: Path) -> None:
    with Emulator("cyton", "--signal", "hum") as board:
        examination = told(
            tmp_path,
            f'[emg]\ndriver = "cyton"\nkind = "raw"\noptions = {{ port = "{board.port}", measure_s = 0.3 }}\n',
        )
    assert examination.exit_code == 0
    assert any("50 Hz mains" in f.finding for f in examination.findings if f.status == "doubt")


def test_a_player_that_is_not_there(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as player:
        port = player.address["port"]
    finding = only(told(tmp_path, f'[vest]\ndriver = "bhaptics-player"\noptions = {{ port = {port} }}\n'))
    assert finding.status == "missing"
    assert "cannot be reached" in finding.finding
    assert "start the bHaptics Player" in finding.todo[0]


def test_a_player_without_a_vest(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as player:
        player.say("no-vest")
        port = player.address["port"]
        finding = only(told(tmp_path, f'[vest]\ndriver = "bhaptics-player"\noptions = {{ port = {port} }}\n'))
    assert "has no vest connected" in finding.finding


@pytest.mark.parametrize(
    ("fault", "status", "said"), [("black", "wrong", "black"), ("cut", "missing", "does not open")]
)
def test_a_camera_in_trouble(tmp_path: Path, fault: str, status: str, said: str) -> None:
    with Emulator("digit") as camera:
        camera.say(fault)
        finding = only(
            told(
                tmp_path,
                f'[tactile.thumb]\ndriver = "digit"\noptions = {{ source = "{camera.address["source"]}" }}\n',
            )
        )
    assert finding.status == status
    assert said in finding.finding


def test_a_camera_slower_than_agreed_and_a_baseline_of_another_size(tmp_path: Path) -> None:
    import numpy as np

    np.save(tmp_path / "gel.npy", np.zeros((240, 320, 3), np.uint8))
    with Emulator("digit", "--rate-hz", "15") as camera:
        examination = told(
            tmp_path,
            '[tactile.thumb]\ndriver = "digit"\nbaseline = "gel.npy"\n'
            f'options = {{ source = "{camera.address["source"]}" }}\n',
        )
    slow, baseline = examination.findings
    assert "where 60 were agreed" in slow.finding
    assert baseline.status == "wrong"
    assert "gel.npy is 320×240" in baseline.finding


def test_a_package_that_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    finding = only(
        told(tmp_path, '[emg]\ndriver = "cyton"\nkind = "raw"\noptions = { port = "/dev/ttyUSB9" }\n')
    )
    assert finding.status == "missing"
    assert finding.todo == ("install it with: pip install 'tega[lab]'",)


def test_packages_that_drivers_need_to_look_are_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("serial", "serial.tools", "serial.tools.list_ports"):
        monkeypatch.setitem(sys.modules, module, None)
    findings = look_around().findings
    (packages,) = [f for f in findings if f.check == "packages"]
    assert packages.todo == ("install it with: pip install 'tega[lab]'",)
    assert "cyton, serial-emg" in packages.why
    # What was not looked for is not called absent.
    assert not any("no USB serial port" in f.why for f in findings)


def test_one_device_named_twice_is_opened_once(tmp_path: Path) -> None:
    section = 'driver = "digit"\noptions = {{ serial = "D2064{}" }}\n'
    examination = told(tmp_path, f"[tactile.thumb]\n{section.format(1)}[tactile.index]\n{section.format(1)}")
    thumb, index = examination.findings
    assert (thumb.check, thumb.status) == ("tactile.thumb", "missing")
    assert "no camera has the serial number 'D20641'" in thumb.finding
    assert (index.check, index.status) == ("tactile.index", "wrong")
    assert "tactile.thumb name the same device" in index.finding


def test_a_can_bus_that_is_not_there(tmp_path: Path) -> None:
    finding = only(
        told(
            tmp_path, '[hand]\ndriver = "allegro"\noptions = { interface = "socketcan", channel = "can77" }\n'
        )
    )
    assert "no CAN bus 'can77'" in finding.finding


def test_what_would_overwrite_a_recording_is_not_opened(tmp_path: Path) -> None:
    table = tmp_path / "vest.csv"
    table.write_text("kept")
    examination = told(
        tmp_path,
        '[vest]\ndriver = "vest-recorder"\noptions = { file = "vest.csv" }\n'
        '[hand]\ndriver = "can-recorder"\noptions = { file = "vest.csv" }\n',
    )
    assert table.read_text() == "kept"
    assert examination.findings[0].status == "fine"
    assert "needs no device" in examination.findings[0].finding


def test_four_sensors_on_one_bus_are_too_many() -> None:
    from tega.devices.video_nodes import VideoNode

    def bench_of(rate_hz: float, buses: str) -> list[Finding]:
        cameras = [Camera("tactile", f"D{n}", rate_hz, 320 * 240) for n in range(4)]
        nodes = [
            VideoNode(f"/dev/video{n}", "DIGIT", f"D{n}", 0x0200, "2833:0209", bus)
            for n, bus in enumerate(buses)
        ]
        return crowded(cameras, nodes)

    (finding,) = bench_of(60.0, "1111")
    assert "4 sensors share USB bus 1 and send 37 MB/s" in finding.finding
    assert bench_of(60.0, "1122") == []
    assert bench_of(30.0, "1111") == []


def test_an_unexpected_error_of_one_driver_is_one_finding() -> None:
    findings = try_all([Case("emg", "emg", "emg-file", object())], 5.0)
    assert findings[0].status == "wrong"
    assert "unexpected AttributeError" in findings[0].finding


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="only Linux tells")
def test_who_holds_a_device_is_named(tmp_path: Path) -> None:
    device = tmp_path / "video0"
    device.write_text("")
    with device.open():
        (holder,) = holders(str(device))
    assert holder.endswith(")")
    assert holders(str(device)) == []


# A stranger's driver.

STRANGER = """
from typing import Any, ClassVar
from tega.devices import DeviceInfo, Found, Options

class Claw:
    kind: ClassVar[str] = "hand"
    summary: ClassVar[str] = "a claw"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = Options
    def __init__(self, options: Any) -> None: ...
    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        return [Found(driver="claw", label="claw 1")]
    @property
    def info(self) -> DeviceInfo:
        return DeviceInfo(driver="claw", kind="hand", label="claw 1", live=True)
    def open(self) -> None:
        raise AssertionError("a hand was opened that cannot be opened without force")
    def close(self) -> None: ...
"""


def test_a_stranger_s_driver_takes_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "claw_module.py").write_text(textwrap.dedent(STRANGER))
    about = tmp_path / "claw-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: claw\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[tega.devices]\nclaw = claw_module:Claw\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    (finding,) = [f for f in look_around().findings if f.driver == "claw"]
    assert finding.check == "allegro"
    assert "was not opened" in finding.finding


# Settings files that are written.


def test_init_never_overwrites_by_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "lab.toml"
    out.write_text("mine")
    _, err = call(capsys, "init", "--out", out, code=1)
    assert "nothing was written" in err
    assert out.read_text() == "mine"
    said, _ = call(capsys, "init", "--out", out, "--force", code=0)
    assert f"tega-teleop doctor {out}" in said
    assert call(capsys, "config", "check", out, code=0)[0] == "lab.toml: ok\n"


def test_what_is_written_holds_what_was_found(tmp_path: Path) -> None:
    from tega.devices import Found
    from tega.doctor import lab_settings

    digits = [
        Found(driver="digit", label=f"D{n}", options={"serial": f"D{n}"}, problem="busy" if n == 3 else "")
        for n in range(6)
    ]
    board = Found(driver="serial-emg", label="/dev/ttyACM0", options={"port": "/dev/ttyACM0"})
    stream = Found(driver="lsl-emg", label="amp", options={"by": "source_id", "value": 'a"b\\c'})
    vest = Found(driver="bhaptics-ble", label="X40", options={"address": "AA:BB"})
    hand = Found(
        driver="allegro",
        label="can0\n[evil]",
        options={"interface": "socketcan", "channel": "can0"},
        problem="down",
        hint="do:\nip link",
    )
    path = tmp_path / "lab.toml"
    looked: dict[str, Any] = {
        "digit": Looked("tactile", digits),
        "serial-emg": Looked("emg", [board]),
        "lsl-emg": Looked("emg", [stream]),
        "bhaptics-ble": Looked("vest", [vest]),
        "allegro": Looked("hand", [hand]),
    }
    path.write_text(lab_settings(looked, name=path.name))
    config = load_config(path, environ={}).config
    # The one that cannot be used goes last, and with six found it has no finger.
    assert [c.options.serial for c in config.tactile.in_use().values()] == ["D0", "D1", "D2", "D4"]
    assert config.emg is not None
    assert config.emg.options.value == 'a"b\\c'
    assert config.vest.options.limit == 60
    assert (config.hand.options.torque_share, config.hand.options.side) == (0.3, "right")
    text = path.read_text()
    assert 'also found: /dev/ttyACM0: driver = "serial-emg"' in text
    assert "# Not usable yet: down" in text


def test_the_rules_are_printed_and_allow_what_the_drivers_open(capsys: pytest.CaptureFixture[str]) -> None:
    import re

    out, _ = call(capsys, "doctor", "--udev-rules", code=0)
    rules = [line for line in out.splitlines() if line and not line.startswith("#")]
    clause = r'[A-Z]+(?:\{[A-Za-z_]+\})?(?:==|=|\+=)"[^"]*"'
    for rule in rules:
        assert re.fullmatch(rf"{clause}(?:, {clause})*", rule), rule
    for vendor in ("2833", "1209", "256f"):
        assert any(f'"{vendor}"' in rule for rule in rules)
    assert "/etc/udev/rules.d/70-tega.rules" in out


# Vests over other links.


@pytest.mark.skipif(shutil.which("dbus-daemon") is None, reason="dbus-daemon is not installed")
def test_a_vest_over_bluetooth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tega.devices.vest_ble import BleVest

    with Emulator("bluez_vest") as vest:
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", vest.address["bus"])
        (found,) = BleVest.discover(3.0)
        assert found.label.startswith(("TactSuit", "Tactot"))
        assert not found.may_open
        (seen,) = [f for f in look_around().findings if f.check == "vest"]
        assert found.label in seen.finding
        finding = only(
            told(
                tmp_path,
                '[vest]\ndriver = "bhaptics-ble"\n'
                f'options = {{ scan_s = 1.0, address = "{found.options["address"]}" }}\n',
            )
        )
        assert finding.status == "fine"
        assert not any(any(motors) for _, motors in seen_by(vest).history)


def test_a_vest_board_that_may_not_be_opened(tmp_path: Path) -> None:
    from tega.devices.vest_hid import HidVest
    from tega.testing.emulators.hid_port import HidPort

    with Emulator("hid_bridge", str(tmp_path)) as vest:
        port = HidPort(vest.address["path"])
        with port.installed():
            assert [found.options for found in HidVest.discover(1.0)] == [{"serial": "EMULATED"}]
            settings = '[vest]\ndriver = "hid-vest"\n'
            assert only(told(tmp_path, settings)).status == "fine"
            port.can_open = False
            finding = only(told(tmp_path, settings))
    assert "does not open" in finding.finding
    assert any("udev rule" in step for step in finding.todo)
