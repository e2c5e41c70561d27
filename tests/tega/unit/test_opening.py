"""A run opens its devices at the same time, and nothing that moves before all that it measures with is there."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from reference.processes import begun_by
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow


def _run(tree: dict[str, Any], folder: Path) -> None:
    run_session(check_tree(tree, {}, base=folder).config)


def test_a_hand_is_not_touched_where_a_source_is_missing(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True) as lab:
        lab.tree["emg"]["options"] |= {"start_s": 0.5}
        lab.emg.say("freeze")
        with pytest.raises(DeviceUnavailableError, match="cyton"):
            _run(lab.tree, tmp_path)
        check = lab.hand.say("look")
        assert (check["torques"], check["servo_on"], check["reports"]) == (0, False, False)
        for module in ("tega.devices.hand.hand_program", "tega.devices.hand.hand_guard"):
            assert begun_by(os.getpid(), module) == []


def test_the_first_missing_device_is_told_and_what_was_opened_is_closed(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=500.0, fingers=("thumb",)) as lab:
        lab.tree["emg"]["options"] |= {"measure_s": 0.25}
        with Emulator("digit") as absent:
            lab.tree["tactile"]["index"] = {
                **lab.tree["tactile"]["thumb"],
                "options": {"source": absent.address["source"], "warm_up_s": 0.1},
            }
        with pytest.raises(DeviceUnavailableError, match="does not open"):
            _run(lab.tree, tmp_path)
        assert bytes.fromhex(lab.emg.say("heard")["heard"]).endswith(b"START\nSTOP\n")


def test_a_source_that_is_missing_is_told_before_the_muscles(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, fingers=("thumb",)) as lab:
        lab.tree["emg"]["options"]["port"] = str(tmp_path / "no-port")
        lab.sensors["thumb"].kill()
        with pytest.raises(DeviceUnavailableError, match="digit"):
            _run(lab.tree, tmp_path)
