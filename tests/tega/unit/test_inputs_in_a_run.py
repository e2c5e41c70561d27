"""What the operator holds or steps on, as a run opens, counts and shows it."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console

from reference.held import PEDAL, TWO
from reference.parts import observed
from reference.played import finger
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.ui.view.state import ViewState
from tega.ui.view.terminal import render
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux"),
]


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


def test_a_run_that_names_a_missing_input_does_not_begin() -> None:
    settings = {
        "tactile": {"thumb": finger(0.2, seed=1)},
        "input": {"dead_man": {"driver": "pedal", "options": {"silent_after_ms": 100.0}}},
    }
    with HidPort().installed(), pytest.raises(DeviceUnavailableError, match="no pedal that is known"):
        run_session(check_tree(settings, {}, base=Path.cwd()).config)
