"""The page tells of the decoder: closure, confidence, hold, decoders beside; and of fatigue and moved electrodes."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.moments import completed
from tega.records import Adaptation, BesideIntent, Button, Intent, MuscleCondition
from tega.records.bus import Bus
from tega.ui.view.browser.feed import DecodersApart, MuscleRows, SessionFeed
from tega.ui.view.browser.state_html import run_state_html, status_html
from tega_learn.decoders import fit


def reported(apart: DecodersApart, pairs: list[tuple[float, float]], *, late_ns: int = 0) -> None:
    for k, (ours, theirs) in enumerate(pairs):
        apart.connected(Intent(t_ns=k * 100_000_000, level=1, closure=ours))
        apart.beside(BesideIntent(stage="rules", t_ns=k * 100_000_000 + late_ns, level=1, closure=theirs))


def test_closures_apart_by_more_than_half_a_level_are_counted_over_ten_seconds() -> None:
    apart = DecodersApart()
    reported(apart, [(0.0, 1.0)] * 50 + [(0.5, 0.6)] * 75 + [(0.5, 0.75)] * 25)
    assert apart.rows() == {"beside rules": "closure 0.75 (connected 0.50), apart in 25 % of 10 s"}


def test_blocks_of_other_lengths_are_paired_by_their_times_once_both_have_said_something() -> None:
    apart = DecodersApart()
    reported(apart, [(0.5, 0.5)] * 20, late_ns=-40_000_000)
    assert apart.rows()["beside rules"].endswith("apart in 0 % of 10 s")
    apart = DecodersApart()
    apart.beside(BesideIntent(stage="rules", t_ns=0, level=3))
    assert apart.rows() == {}


def test_a_run_that_is_looked_at_has_its_decoders_beside_without_a_recording(tmp_path: Path) -> None:
    tree = {
        "session": {"pace": "fast", "duration_s": 3.0},
        "emg": {"driver": "synthetic-emg", "kind": "raw"},
        "stages": {"beside": [{"group": "decoder", "name": "proportional"}]},
    }
    assert "apart in" in completed(tree, tmp_path)[-1].rows["beside proportional"]


def test_the_pages_button_presses_the_key_that_undoes() -> None:
    bus, pressed = Bus(), list[Button]()
    feed = SessionFeed({}, bus)
    bus.subscribe(Button, pressed.append)
    feed.press("undo")
    assert [(one.seat, one.pressed) for one in pressed] == [("undo", True)]


def test_what_is_told_of_the_muscles_becomes_a_line_each_and_nothing_has_none() -> None:
    bus = Bus()
    rows = MuscleRows(bus)
    assert rows.rows() == {}
    bus.publish(Intent(t_ns=0, level=3, channels=(3, 3)))
    assert rows.rows() == {}  # levels stand elsewhere on the page
    bus.publish(Intent(t_ns=1, closure=0.52, confidence=0.87, channels=(2, 3)))
    assert rows.rows() == {"decoder": "closure 0.52, 87 % sure"}
    bus.publish(Adaptation(t_ns=0, n_samples=1, why="rest", gains=(1.04, 1.0), offsets=(0.0, 0.0)))
    assert rows.rows()["adaptation"] == "gains 1.04 · 1.00 (rest)"
    bus.publish(Adaptation(t_ns=0, n_samples=2, why="undone", gains=(1.0, 1.0), offsets=(0.0, 0.0)))
    assert rows.rows()["adaptation"] == "undone"
    nan = math.nan
    nothing: dict[str, Any] = {"t_ns": 2, "median_hz": (nan, nan), "slope_percent_per_min": (nan, nan)}
    bus.publish(MuscleCondition(**nothing))
    assert set(rows.rows()) == {"decoder", "adaptation"}
    known: dict[str, Any] = {"median_hz": (81.2, nan), "slope_percent_per_min": (-3.14, nan)}
    bus.publish(MuscleCondition(**(nothing | known), pattern_change=0.123))
    assert rows.rows()["fatigue"] == "median frequency 81 · – Hz, -3.1 · – %/min"
    assert rows.rows()["electrodes"] == "pattern 12 % off the run's first"


def test_a_hold_is_told_with_its_reason() -> None:
    bus = Bus()
    rows = MuscleRows(bus)
    bus.publish(Intent(t_ns=1, closure=0.52, confidence=0.2, channels=(2, 3)))
    assert rows.rows("20 % sure, 50 % are needed") == {
        "decoder": "holds closure 0.52: 20 % sure, 50 % are needed"
    }
    bus.publish(Intent(t_ns=2, closure=0.52, confidence=0.0, channels=(0, 0)))
    assert rows.rows() == {"decoder": "holds closure 0.52: no channel can be believed"}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fit a model to rest and effort, and write a recording: rest, effort, then twenty times as strong."""
    pytest.importorskip("sklearn", reason="scikit-learn is not installed")
    folder = tmp_path_factory.mktemp("learned")
    rng = np.random.default_rng(3)

    def emg(closures: list[float]) -> tuple[Any, Any]:
        closure = np.repeat(closures, 1000)
        return rng.normal(size=(len(closure), 2)) * (2 + 40 * closure[:, np.newaxis]), closure

    samples, closure = emg([0.0, 1.0, 0.5, 0.0] * 4)
    fit(samples, closure, rate_hz=1000, tau=100, channels=("ch1", "ch2")).save(folder / "model.json")
    known, _ = emg([0.0, 0.5, 1.0])
    strange, _ = emg([20.0, 20.0])
    np.save(folder / "emg.npy", np.concatenate([known, strange]))
    return folder


def tree_of(folder: Path, maximum: float = 2000.0) -> dict[str, Any]:
    """Return the settings for a folder's samples, calibrated to a maximum."""
    (folder / "calibration.toml").write_text(
        'format = "tega-calibration"\nversion = 1\npreset = "live"\norigin = "made up"\n[emg]\nkind = "raw"\n'
        f'rate_hz = 1000.0\ntau = 100\nchannels = ["ch1", "ch2"]\nmaxima = [{maximum}, {maximum}]\n'
    )
    return {
        "session": {"pace": "fast"},
        "calibration": {"file": "calibration.toml"},
        "emg": {"driver": "emg-file", "kind": "raw", "options": {"file": "emg.npy", "rate_hz": 1000}},
    }


def learned(folder: Path, **options: float) -> dict[str, Any]:
    """Return the settings with the model as the decoder."""
    decoder = {"name": "learned", "options": {"model": str(folder / "model.json"), **options}}
    return tree_of(folder) | {"stages": {"decoder": decoder}}


def test_a_run_shows_how_sure_its_decoder_is_and_that_it_holds_what_it_does_not_know(lab: Path) -> None:
    rows = [moment.rows for moment in completed(learned(lab), lab)]
    sure = [row["decoder"] for row in rows if "sure" in row.get("decoder", "")]
    assert re.fullmatch(r"closure \d\.\d\d, \d+ % sure", sure[0])
    assert rows[-1]["decoder"].endswith(": this effort is like none that the model knows")
    assert rows[-1]["decoder"].startswith("holds closure ")
    assert "fatigue" in rows[-1]


def test_a_run_shows_that_it_holds_for_want_of_confidence(lab: Path) -> None:
    moments = completed(learned(lab, hold_below=1.0), lab)
    assert any(one.rows.get("decoder", "").endswith(" % sure, 100 % are needed") for one in moments)


@pytest.mark.raises("muscles")
def test_the_alert_of_moved_electrodes_and_the_pattern_stand_on_the_page(tmp_path: Path) -> None:
    """Simulated: the muscle under the first electrode is under the second one after ten seconds."""
    rng = np.random.default_rng(5)
    size = np.repeat([[30.0, 6.0], [6.0, 30.0]], [10_000, 7_000], axis=0)
    np.save(tmp_path / "emg.npy", rng.normal(size=size.shape) * size)
    last = completed(tree_of(tmp_path, 40.0), tmp_path)[-2]
    assert any("recalibrate in ten seconds" in alert for alert in last.loop.alerts)
    assert "electrodes have moved or come loose" in run_state_html(last.loop)
    assert re.search(r"electrodes</td>.*pattern \d\d % off the run", status_html(last))
    assert re.search(r"fatigue</td>.*median frequency – · \d+ Hz", status_html(last))
