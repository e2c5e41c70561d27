"""Learned decoders in runs, from a tracked curve to a replay, and what the page shows of decoders and muscles."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.kept import muscle_file
from reference.moments import completed
from reference.played import EMG_HZ
from reference.sessions import attached, read_recorded, tree
from reference.wizard import teleop
from tega.config import check_tree
from tega.config.calibration.records import utc_now, write_record
from tega.devices.base import EmgChunk
from tega.errors import CalibrationError
from tega.loop import run_session
from tega.recording.replay import replay_file
from tega.records import Adaptation, Alert, BesideIntent, Button, Intent, MuscleCondition
from tega.records.bus import Bus
from tega.ui.view.browser.feed import DecodersApart, MuscleRows, SessionFeed
from tega.ui.view.browser.state_html import run_state_html, status_html
from tega_learn.decoders import LearnedDecoder, fit
from tega_learn.logs import PracticeRecord, read_tracked
from tega_practice.tracking import Curve, keep_tracked, tracked_samples

pytest.importorskip("sklearn", reason="scikit-learn is not installed")


def tracked(folder: Path, names: tuple[str, ...], rate_hz: float, seconds: float = 40.0) -> Path:
    """Keep what a person tracks who follows the curve 0.3 s late; the samples are made up."""
    curve = Curve(seconds, seed=1)
    rng = np.random.default_rng(1)
    n = int(seconds * rate_hz)
    effort = np.array([(curve.at(max(0.0, (k + 1) / rate_hz - 0.3)) - 1) / 4 for k in range(n)])
    emg = rng.normal(size=(n, len(names))) * (0.02 + effort[:, None])
    size = round(0.05 * rate_hz)
    parts = [(first, emg[first : first + size]) for first in range(0, n, size)]
    chunks = [
        EmgChunk(10**9 + round((first + len(part)) / rate_hz * 1e9), 700 + first, part)
        for first, part in parts
    ]
    record = folder / "20261122-150405.toml"
    who: dict[str, Any] = {"person": "p01", "device": "d", "driver": "synthetic-emg", "preset": "live"}
    what: dict[str, Any] = {"duration_s": seconds, "in_target_percent": 50.0, "rms_error_levels": 0.5}
    emg_of: dict[str, Any] = {"kind": "raw", "rate_hz": rate_hz, "channels": names}
    write_record(PracticeRecord(seed=1, made=utc_now(), **who, **what, **emg_of), record)
    keep_tracked(tracked_samples(chunks, curve, rate_hz=rate_hz, start_ns=10**9), record)
    found, _ = read_tracked(record)
    assert np.array_equal(found.samples, emg)
    assert found.target[-1] == (curve.at(seconds) - 1) / 4
    return record


def test_tracking_teaches_a_decoder_that_a_run_uses_and_a_replay_repeats(tmp_path, capsys):
    settings = tree(tmp_path / "rec")
    del settings["tactile"]
    settings["stages"] = {
        "beside": [{"group": "decoder", "name": "rules"}],
        "decoder": {"name": "learned", "options": {"model": str(tmp_path / "p01.json")}},
    }
    names, rate_hz = ("ch1", "ch2", "ch3"), float(EMG_HZ)
    record = tracked(tmp_path, names, rate_hz)
    assert teleop("emg", "fit", str(record), "--out", str(tmp_path / "p01.json"), "--json") == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["person"] == "p01"
    assert -0.5 <= reported["lag_s"] <= -0.1
    assert reported["in_sample"]["rank_correlation"] > 0.9
    decoder = LearnedDecoder.load(tmp_path / "p01.json")
    assert decoder.model.channels == names
    summary = run_session(check_tree(settings, {}, base=Path.cwd()).config)
    file = tmp_path / "rec" / str(summary["recording"]["file"])
    model = (tmp_path / "p01.json").read_bytes()
    assert attached(file)["stage-decoder-model.json"] == model
    # The recording holds the model: another file in its place, or none, changes nothing.
    (tmp_path / "p01.json").unlink()
    replay = replay_file(file)
    assert replay.same
    levels = next(s for s in replay.streams if s.stream == "/emg/levels")
    assert levels.recorded == levels.replayed > 10


def test_a_tracked_curve_without_emg_is_told(tmp_path: Path) -> None:
    record = tracked(tmp_path, ("a",), 200.0, 12.0)
    record.with_suffix(".npy").write_bytes(b"nothing")
    with pytest.raises(CalibrationError, match="damaged"):
        read_tracked(record)
    record.with_suffix(".npy").unlink()
    with pytest.raises(CalibrationError, match="keeps no EMG"):
        read_tracked(record)


def test_decoders_are_compared_on_what_a_person_practised(tmp_path, capsys):
    record = tracked(tmp_path, ("a", "b", "c"), 200.0, 90.0)  # rest and effort in both halves
    assert teleop("emg", "compare", str(record), "--decoders", "rules,learned", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    halves = ("second half", "first half (swapped)")
    wanted = [(decoder, half) for half in halves for decoder in ("rules", "learned")]
    assert [(row["decoder"], row["judged_on"]) for row in rows] == wanted
    assert all(row["rank_correlation"] > 0.8 for row in rows if row["decoder"] == "learned")
    assert teleop("emg", "compare", str(record), "--channels", "1,4") == 2
    assert "has 3 channels" in capsys.readouterr().err
    bare = tmp_path / "log.npy"
    np.save(bare, np.zeros((400, 5)))
    assert teleop("emg", "compare", str(bare), "--target", "4", "--channels", "1") == 2
    assert "name its --rate-hz" in capsys.readouterr().err


def test_compare_prints_draws_and_gives_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    rng = np.random.default_rng(1)
    closure = np.tile(np.repeat([0.0, 1.0, 0.0, 0.5], 400), 4)
    emg = rng.normal(size=(len(closure), 3)) * (5 + 90 * closure[:, None])
    file = tmp_path / "log.npy"
    np.save(file, np.column_stack([emg, closure]))
    words = ["emg", "compare", str(file), "--target", "4", "--channels", "1,2,3", "--rate-hz", "200"]
    assert teleop(*words, "--picture", str(tmp_path / "p.png")) == 0
    assert "learned" in capsys.readouterr().out
    assert (tmp_path / "p.png").stat().st_size > 10_000
    assert teleop(*words, "--decoders", "learned,rules", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 4
    assert {"rank_correlation", "delay_s", "false_closings_per_min", "calibration_error"} <= set(rows[0])
    for name, value in (("rest", 0), ("close", 1)):
        np.save(tmp_path / f"{name}.npy", emg[closure == value][:800])
    one = f"{tmp_path}/rest.npy=0,{tmp_path}/close.npy=1"
    words = ["emg", "compare", f"{one},{one},{one}", "--rate-hz", "200"]
    assert teleop(*words, "--decoders", "learned", "--json") == 0
    assert all(row["balanced_accuracy"] > 0.9 for row in json.loads(capsys.readouterr().out))
    for name, value in (("rest9", 0), ("close9", 1)):
        np.save(tmp_path / f"{name}.npy", emg[closure == value][800:1600][:, [1, 2, 0]] * [0.3, 3.0, 1.0])
    days = [f"{tmp_path}/rest{n}.npy=0,{tmp_path}/close{n}.npy=1" for n in ("", "9")]
    words = ["emg", "compare", f"{days[1]},{days[1]}", "--train", f"{days[0]},{days[0]}", "--rate-hz", "200"]
    assert teleop(*words, "--recalibrate", "10", "--decoders", "rules,learned", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["duration_s"] for row in rows] == [pytest.approx(6.0)] * 2
    assert all("recalibrated by its first 10 s" in row["judged_on"] for row in rows)
    assert all(row["trained_on"] == "rest.npy and 3 more" for row in rows)
    assert rows[1]["balanced_accuracy"] > 0.95
    assert teleop(*words, "--recalibrate", "16") != 0
    assert "leave some of it to be judged" in capsys.readouterr().err
    assert teleop("emg", "compare", str(file), "--rate-hz", "200") == 2


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
    why = "20 % sure, 50 % are needed"
    assert rows.rows(why) == {"decoder": f"holds closure 0.52: {why}"}
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
    return {
        "session": {"pace": "fast"},
        "calibration": {"file": str(muscle_file(folder, maximum, maximum, rate_hz=1000.0))},
        "emg": {"driver": "emg-file", "kind": "raw", "options": {"file": "emg.npy", "rate_hz": 1000}},
    }


def learned(folder: Path, **options: float) -> dict[str, Any]:
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
def test_moved_electrodes_are_a_recorded_alert_and_stand_on_the_page_with_the_pattern(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    size = np.repeat([[30.0, 6.0], [6.0, 30.0]], [10_000, 7_000], axis=0)
    np.save(tmp_path / "emg.npy", rng.normal(size=size.shape) * size)
    recording = {"dir": str(tmp_path / "recorded"), "stop_free_mib": 0.0}
    last = completed(tree_of(tmp_path, 40.0) | {"recording": recording}, tmp_path)[-2]
    alerts = read_recorded(next(tmp_path.rglob("*.mcap")), Alert).of(Alert)
    assert any("refresh the calibration" in alert.said for alert in alerts)
    assert any("refresh the calibration" in alert for alert in last.loop.alerts)
    assert "electrodes have moved or come loose" in run_state_html(last.loop)
    assert re.search(r"electrodes</td>.*pattern \d\d % off the run", status_html(last))
    assert re.search(r"fatigue</td>.*median frequency – · \d+ Hz", status_html(last))
