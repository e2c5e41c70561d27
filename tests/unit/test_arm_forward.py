"""``tega-teleop arm forward`` on an emulated headset whose wrist goes one way or another."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from reference.trackers import wrist_goes
from tega.arm import StampedPose
from tega.arm.sweep import ForearmSweep
from tega.cli.forward import forward
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


def test_forward_is_found_and_checked(tmp_path: Path) -> None:
    with moving(tmp_path, 0.5) as file:
        said = CliRunner().invoke(forward, [str(file), "--json"])
    told = json.loads(said.output)
    assert said.exit_code == 0
    assert told["yaw_rad"] == pytest.approx(0.5, abs=0.03)
    assert (told["ok"], told["words"]) == (True, "forward is forward")


@pytest.mark.slow
def test_the_operator_sees_how_the_check_goes_and_what_to_set(tmp_path: Path) -> None:
    with moving(tmp_path, -0.3) as file:
        said = CliRunner().invoke(forward, [str(file)])
    assert said.exit_code == 0, said.output
    assert "forward [####################]  +20 cm" in said.output
    assert "forward is forward" in said.output
    assert "  [arm.mapping]\n  yaw_rad = -0." in said.output


def test_a_tracker_that_sees_nothing_is_told(tmp_path: Path) -> None:
    with moving(tmp_path, 0.0) as file, Emulator("hololens") as blind:
        blind.say("lose")
        file.write_text(
            file.read_text().split("options")[0]
            + f"options = {{ host = '127.0.0.1', port = {blind.port} }}\n"
        )
        said = CliRunner().invoke(forward, [str(file), "--json", "--seconds", "1"])
    assert "the forearm was not seen within 1 s" in str(said.exception)


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
