"""Runs on live devices: the loss of a source, what the operator holds, and nothing moves before all is there."""

from __future__ import annotations

import io
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from reference.held import PEDAL, TWO
from reference.kept import muscle_file
from reference.parts import Given, observed
from reference.played import finger
from reference.processes import begun_by
from tega.config import check_tree
from tega.config.calibration import EmgMaxima
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.loop.snapshot import LoopView
from tega.stages.decoders import RulesDecoder, RulesOptions
from tega.ui.view.state import ViewState
from tega.ui.view.terminal import render
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator

linux = pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")


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
        options = {"port": device.port, "measure_s": 0.25}
        tree: dict[str, Any] = {
            "session": {"duration_s": 3.0},
            "calibration": {"file": str(muscle_file(tmp_path, 300.0, 300.0, 300.0, rate_hz=250.0))},
            "emg": {"driver": "cyton", "kind": "raw", "options": options},
        }
        config = check_tree(tree, {}, base=tmp_path).config
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
    assert any("Cyton firmware v3.1.2, gain 24" in note for note in summary["notes"])


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
        # Where the muscles are missing too, the finger is told.
        lab.tree["emg"]["options"]["port"] = str(tmp_path / "no-port")
        with pytest.raises(DeviceUnavailableError, match="digit"):
            run_session(check_tree(lab.tree, {}, base=tmp_path).config)


@pytest.mark.slow
@linux
def test_a_run_shows_and_counts_what_the_operator_holds(tmp_path: Path) -> None:
    seen: list[LoopView] = []
    with (
        Emulator("hid_input", "--device", "spacemouse") as cap,
        Emulator("hid_input", "--device", "pedal-keyboard") as foot,
        HidPort(HidBoard(cap.port, *TWO), HidBoard(foot.port, *PEDAL)).installed(),
    ):
        settings = {
            "session": {"duration_s": 30.0, "out_dir": str(tmp_path / "out")},
            "tactile": {"thumb": finger(30.0, shape=(60, 80))},
            "input": {
                "motion": {"driver": "spacemouse"},
                "dead_man": {"driver": "spacemouse", "button": "left", "options": {"silent_after_ms": 1e4}},
                "marker": {"driver": "pedal", "button": "c"},
            },
        }

        def watch(view: LoopView) -> None:
            if not seen:
                cap.say("push 0 -350 0 0 0 0")
                cap.say("press 1")
                cap.say("press 0")
                foot.say("press 0")
                time.sleep(0.1)  # no bounce
                foot.say("lift 0")
                foot.say("press 1")
            seen.append(view)

        def over() -> bool:
            inputs = seen[-1].inputs if seen else {}
            return bool(inputs) and inputs["marker"].held and inputs["motion"].state.motion[0] == 1.0

        loaded = check_tree(settings, {}, base=Path.cwd())
        assert loaded.values["input.dead_man.button"].value == "left"
        summary = run_session(loaded.config, controls=Controls(stop=over), bus=observed(watch))
    inputs = seen[-1].inputs
    assert inputs["dead_man"].held
    assert inputs["marker"].n_presses == 1
    assert summary["ended"] == "stopped"
    marker = summary["inputs"]["marker"]
    assert (marker["driver"], marker["source"], marker["presses"]) == ("pedal", "PCsensor FootSwitch", 1)
    assert marker["no_data_share"] == 0.0
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(render(seen[-1], title="test", rates_hz={}))
    page = pytest.importorskip("tega.ui.view.browser.state_html", reason="needs the extra tega[view]")
    for drawn in (console.export_text(), page.status_html(ViewState(seen[-1].t_ns, seen[-1]))):
        assert all(text in drawn for text in ("dead man", "x +1.00", "held, 1 press"))


@linux
def test_a_run_that_names_a_missing_input_does_not_begin() -> None:
    settings = {
        "tactile": {"thumb": finger(0.2, seed=1)},
        "input": {"dead_man": {"driver": "pedal", "options": {"silent_after_ms": 100.0}}},
    }
    with HidPort().installed(), pytest.raises(DeviceUnavailableError, match="no pedal that is known"):
        run_session(check_tree(settings, {}, base=Path.cwd()).config)
