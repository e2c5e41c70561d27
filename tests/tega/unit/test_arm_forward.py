"""``tega-teleop arm forward`` on an emulated headset whose wrist goes one way or another."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from reference.trackers import wrist_goes
from tega.arm import StampedPose
from tega.arm.heading import ForearmSweep
from tega.config import load_config
from tega.config.calibration.records import ArmRecord, read_record
from tega.errors import CalibrationError
from tega.setup.calibration.steps_arm import take_base_yaw, take_heading
from tega.ui.cli.arm import forward
from tega.ui.cli.calibrate import calibrate
from tega.ui.cli.guide import LineGuide
from tega_emulators.process import Emulator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")

_TURN = (0.0, 0.0, 0.0, 1.0)


@contextmanager
def moving(folder: Path, *headings_rad: float) -> Iterator[Path]:
    """A wrist that goes 20 cm along each heading in turn and rests, over and over."""
    with Emulator("hololens") as headset:
        file = folder / "lab.toml"
        host, port = headset.address["host"], headset.address["port"]
        file.write_text(
            f'[arm]\ndriver = "simulated-arm"\n[arm.tracker]\ndriver = "hololens"\n'
            f'options = {{ host = "{host}", port = {port} }}\n'
        )
        with wrist_goes(headset, *headings_rad):
            yield file


@pytest.mark.slow
def test_forward_is_found_and_checked_and_the_operator_sees_what_to_set(tmp_path: Path) -> None:
    with moving(tmp_path, 0.5) as file:
        text = CliRunner().invoke(forward, [str(file), "--json"])
        displayed = CliRunner().invoke(forward, [str(file)])
    reported = json.loads(text.output)
    assert text.exit_code == displayed.exit_code == 0
    assert reported["yaw_rad"] == pytest.approx(0.5, abs=0.03)
    assert (reported["ok"], reported["words"]) == (True, "forward is forward")
    assert "forward [####################]  +20 cm" in displayed.output
    assert "forward is forward" in displayed.output
    assert "  [arm.mapping]\n  yaw_rad = 0." in displayed.output


@pytest.mark.slow
def test_the_wizard_keeps_forward_for_a_person_and_a_run_follows_it(tmp_path: Path) -> None:
    words = ["--person", "p01", "--only", "arm", "--time-scale", "0.1", "--json"]
    with moving(tmp_path, 0.5) as file:
        text = CliRunner().invoke(calibrate, [str(file), *words], input="\n\nt\n")
        assert text.exit_code == 0, text.output
        (kept,) = (tmp_path / "calibrations" / "people" / "p01").glob("arm-*.toml")
        record = read_record(kept, ArmRecord)
        assert record.yaw_rad == pytest.approx(0.5, abs=0.03)
        assert (record.person, record.frame, record.driver) == ("p01", "openxr", "hololens")
        loaded = load_config(file, sets=('calibration.person="p01"',))
        assert loaded.config.arm is not None
        assert loaded.config.arm.mapping.yaw_rad == record.yaw_rad
        assert loaded.config.arm.mapping.base_yaw_rad == record.base_yaw_rad == 3.1415
        assert loaded.values["arm.mapping.yaw_rad"].origin == f"people/p01/{kept.name}"
        # What the settings say themselves wins, and another person has nothing of it.
        given = load_config(file, sets=('calibration.person="p01"', "arm.mapping.yaw_rad=-1.0"))
        other = load_config(file, sets=('calibration.person="p02"',))
    assert given.config.arm is not None
    assert given.config.arm.mapping.yaw_rad == -1.0
    assert other.config.arm is not None
    assert other.config.arm.mapping.yaw_rad == 0.0


class _Scripted:
    """A tracker that has each of its movements in one read, and nothing before it."""

    frame, problem = "openxr", ""

    def __init__(self, *headings_rad: float) -> None:
        self._coming: list[list[StampedPose]] = []
        for heading in headings_rad:
            route = np.array([-np.sin(heading), 0.0, -np.cos(heading)])
            places = [0.01 * min(k, 20) * route for k in range(100)]
            sweep = [StampedPose(k * 10_000_000, tuple(place), _TURN) for k, place in enumerate(places)]
            self._coming += [[], sweep]

    def read(self, _now_ns: int) -> list[StampedPose]:
        return self._coming.pop(0)


def test_a_heading_that_does_not_come_out_forward_is_not_kept() -> None:
    guide = LineGuide(yes=True, get_ready_s=0.0)
    straight: Any = _Scripted(0.4, 0.45)
    yaw_rad, check = take_heading(straight, guide)
    assert yaw_rad == pytest.approx(0.4, abs=1e-3)
    assert check.off_rad == pytest.approx(0.05, abs=1e-3)
    crooked: Any = _Scripted(0.0, 1.2)
    with pytest.raises(CalibrationError, match="forward came out 69° to the left"):
        take_heading(crooked, guide)


@pytest.mark.parametrize(
    ("answer", "headings_rad", "found_rad"),
    [
        ("a", (), 0.0),
        ("l", (), 1.5708),
        ("t", (), 3.1415),
        ("r", (), -1.5708),
        ("", (), 1.0),  # nobody answers: as the settings have it
        # Shown by a movement, and the tracker's forward is 0.4 rad off the operator's.
        ("s", (0.4 + 2.5,), 2.5),
        ("s", (0.4 - 3.0,), -3.0),
    ],
)
def test_which_way_the_base_points_is_asked_or_shown(
    answer: str, headings_rad: tuple[float, ...], found_rad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    displayed: Any = _Scripted(*headings_rad)
    guide = LineGuide(yes=True, get_ready_s=0.0)
    if answer:
        monkeypatch.setattr(guide, "ask", lambda _question, answers: answers[answer] and answer)
    found = take_base_yaw(displayed, guide, yaw_rad=0.4, reported_rad=1.0)
    assert found == pytest.approx(found_rad, abs=1e-3)


def test_a_tracker_that_sees_nothing_is_told(tmp_path: Path) -> None:
    with moving(tmp_path, 0.0) as file, Emulator("hololens") as blind:
        blind.say("lose")
        file.write_text(
            file.read_text().split("options")[0]
            + f"options = {{ host = '127.0.0.1', port = {blind.port} }}\n"
        )
        text = CliRunner().invoke(forward, [str(file), "--json", "--seconds", "1"])
    assert "the forearm was not seen within 1 s" in str(text.exception)


def test_a_movement_is_over_when_it_rests_and_begins_anew_after_a_gap() -> None:
    sweep = ForearmSweep("openxr")
    for k in range(60):
        sweep.take(StampedPose(k * 10_000_000, (0, 0, -0.005 * k), _TURN))
    assert not sweep.done
    np.testing.assert_allclose(sweep.gone_m, (0.295, 0, 0), atol=1e-9)
    for k in range(100, 160):
        sweep.take(StampedPose(k * 10_000_000, (0.1, 0, 0), _TURN))
    assert not sweep.done
    np.testing.assert_allclose(sweep.gone_m, 0, atol=1e-12)
