"""The doctor and ``init`` on what the operator holds or steps on, against emulators behind hidapi's calls."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from reference.command import call
from reference.processes import until
from tega.config import load_config
from tega.setup.doctor import Finding, examine, lab_settings
from tega.setup.doctor.bench import ROLES, probe_all
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator

CAP, FOOT = (0x046D, 0xC626), (0x0C45, 0x7403)
SETTINGS = """
[input.motion]
driver = "spacemouse"
[input.dead_man]
driver = "pedal"
options = { silent_after_ms = 10000 }
[input.marker]
driver = "spacemouse"
button = "right"
"""


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


def reported(folder: Path) -> dict[str, list[Finding]]:
    path = folder / "lab.toml"
    path.write_text(SETTINGS)
    examination = examine(load_config(path, environ={}).config, name=path.name)
    by_check: dict[str, list[Finding]] = {}
    for finding in examination.findings:
        if finding.check != "settings":  # it says that inputs alone make no run
            by_check.setdefault(finding.check, []).append(finding)
    return by_check


@pytest.mark.slow
def test_every_seat_is_examined_and_what_is_wrong_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seats = ["input.motion", "input.dead_man", "input.marker"]
    with attached() as (cap, foot, port):
        found = reported(tmp_path)
        assert list(found) == seats
        assert {f.status for (f,) in found.values()} == {"ok"}
        assert "spacemouse SpaceNavigator is open and at rest" in found["input.motion"][0].finding
        # The inputs are ready, and `run` needs more than them.
        out, _ = call(capsys, "doctor", tmp_path / "lab.toml", code=3)
        assert "he settings name no input" in out

        cap.say("push 0 -350 0 0 0 0")
        # A pedal tells of changes only, so the foot comes down while somebody listens.
        with once_open(port, foot, "press 0"):
            found = reported(tmp_path)
        assert found["input.motion"][0].status == "warning"
        assert "the cap is pushed or turned" in found["input.motion"][0].finding
        assert "touched: " in found["input.dead_man"][0].finding
        assert "is down" in found["input.dead_man"][0].finding
        cap.say("push 0 0 0 0 0 0")
        foot.say("lift 0")

        with once_open(port, cap, "unplug", seats=2):
            found = reported(tmp_path)
        assert [found[seat][0].status for seat in seats] == ["error", "ok", "error"]
        assert "opened, and then had no data" in found["input.motion"][0].finding
        found = reported(tmp_path)
        assert found["input.motion"][0].status == "missing"
        assert found["input.motion"][0].todo
        port.can_open = False
        (finding,) = reported(tmp_path)["input.dead_man"]
        assert finding.status == "error"
        assert "does not open" in finding.finding
        assert any("udev rule" in step for step in finding.todo)


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
