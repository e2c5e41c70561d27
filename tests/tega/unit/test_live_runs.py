"""Runs on live devices: they survive the loss of a source, and nothing moves before all is there."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.kept import muscle_file
from reference.parts import Given, observed
from reference.processes import begun_by
from tega.config import SessionConfig, check_tree
from tega.config.calibration import EmgMaxima
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk
from tega.errors import DeviceUnavailableError
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.loop.session import run_session
from tega.stages.decoders import RulesDecoder, RulesOptions
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator


def test_missing_samples_take_their_time() -> None:
    # 100 samples, 350 missing, 100 samples, at 500 Hz in blocks of 50: eleven blocks of time.
    ones, report = np.ones((100, 1)), SourceReport()
    maxima = EmgMaxima(kind="envelope", rate_hz=500.0, tau=50, channels=("a",), maxima=(1.0,))
    decoder = RulesDecoder(muscle_setup(maxima, "paper"), RulesOptions())
    meter = BlockMeter(decoder, report, maxima=maxima, live=True)
    chunks = EmgChunk(200_000_000, 0, ones), EmgChunk(1_100_000_000, 450, ones)
    blocks = [block for chunk in chunks for block in meter.take(chunk)]
    assert (report.n_items, report.n_missing) == (200, 350)
    assert len(blocks) == 11
    assert [block.channels[0] for block in blocks][:2] == [5, 5]
    # Bad from the first block that lies in the gap, until 100 ms of good samples have come.
    assert 0 in [block.channels[0] for block in blocks]
    assert [block.level for block in blocks] == [5] * 11


def _settings(folder: Path, port: str, *, duration_s: float) -> SessionConfig:
    tree: dict[str, Any] = {
        "session": {"duration_s": duration_s, "out_dir": str(folder / "out")},
        "calibration": {"file": str(muscle_file(folder, 300.0, 300.0, 300.0, rate_hz=250.0))},
        "emg": {"driver": "cyton", "kind": "raw", "options": {"port": port, "measure_s": 0.25}},
    }
    return check_tree(tree, {}, base=folder).config


@pytest.mark.slow
def test_a_run_on_a_board_that_is_unplugged_ends_in_order(tmp_path: Path) -> None:
    with Emulator("cyton", "--signal", "emg", "--fault", "loss=0.02") as device:
        config = _settings(tmp_path, device.port, duration_s=2.5)
        unplugged: list[bool] = []

        def watch(view: Any) -> None:
            if view.t_ns > 1_500_000_000 and not unplugged:
                unplugged.append(True)
                device.say("unplug")

        summary = run_session(config, bus=observed(watch))
    notes = " ".join(summary["notes"])
    assert "emg: lost: cyton: " in notes
    assert "was lost" in notes
    assert "its last level held for 2 s, then the hand opens" in notes
    assert "Cyton firmware v3.1.2, gain 24" in notes
    assert summary["emg"]["samples"] > 100
    assert (tmp_path / "out" / "can.csv").read_text().splitlines()[-1].endswith("104,")


@pytest.mark.slow
def test_a_page_that_asks_all_the_time_does_not_disturb_the_reader(tmp_path: Path) -> None:
    """Another thread asks the source for its notes as fast as it can, as the page's painter once did."""
    over, failed, requested = threading.Event(), list[BaseException](), [0]

    def ask(source: Any, intent: Any) -> None:
        try:
            while not over.is_set():
                assert source.info.unit == "µV"
                assert len(intent.full_scale) == 3
                requested[0] += 1
        except BaseException as error:
            failed.append(error)

    with Emulator("cyton", "--signal", "emg", "--fault", "loss=0.02") as device:
        config = _settings(tmp_path, device.port, duration_s=3.0)
        askers: list[threading.Thread] = []

        def prepared(prepared: Any) -> Any:
            muscles = prepared.muscles
            askers.append(threading.Thread(target=ask, args=(muscles.source, muscles.decoder)))
            askers[0].start()
            return prepared

        try:
            summary = run_session(config, parts=[Given(prepared)])
        finally:
            over.set()
            for asker in askers:
                asker.join()
    assert not failed
    assert requested[0] > 100
    assert summary["ended"] == "duration"
    assert "emg: lost" not in str(summary)


@pytest.mark.slow
def test_a_hand_is_not_touched_where_a_source_is_missing(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True) as lab:
        lab.tree["emg"]["options"] |= {"start_s": 0.5}
        lab.emg.say("freeze")
        with pytest.raises(DeviceUnavailableError, match="cyton"):
            run_session(check_tree(lab.tree, {}, base=tmp_path).config)
        check = lab.hand.say("look")
        assert (check["torques"], check["servo_on"], check["reports"]) == (0, False, False)
        for module in ("tega.devices.hand.hand_program", "tega.devices.hand.hand_guard"):
            assert begun_by(os.getpid(), module) == []


@pytest.mark.slow
def test_the_first_missing_device_is_told_and_what_was_opened_is_closed(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=500.0, fingers=("thumb",)) as lab:
        lab.tree["emg"]["options"] |= {"measure_s": 0.25}
        with Emulator("digit") as absent:
            lab.tree["tactile"]["index"] = {
                **lab.tree["tactile"]["thumb"],
                "options": {"source": absent.address["source"], "warm_up_s": 0.1},
            }
        with pytest.raises(DeviceUnavailableError, match="does not open"):
            run_session(check_tree(lab.tree, {}, base=tmp_path).config)
        assert bytes.fromhex(lab.emg.say("heard")["heard"]).endswith(b"START\nSTOP\n")


@pytest.mark.slow
def test_a_source_that_is_missing_is_told_before_the_muscles(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, fingers=("thumb",)) as lab:
        lab.tree["emg"]["options"]["port"] = str(tmp_path / "no-port")
        lab.sensors["thumb"].kill()
        with pytest.raises(DeviceUnavailableError, match="digit"):
            run_session(check_tree(lab.tree, {}, base=tmp_path).config)
