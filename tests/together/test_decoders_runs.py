"""Learned decoders in runs: from a tracked curve to a model, a run with it, the recording computed again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="scikit-learn is not installed")

from reference.played import EMG_HZ
from reference.sessions import attached, tree
from reference.wizard import teleop
from tega.config import check_tree
from tega.config.calibration.records import utc_now, write_record
from tega.devices.base import EmgChunk
from tega.errors import CalibrationError
from tega.loop import run_session
from tega.recording.replay import replay_file
from tega_learn.decoders import LearnedDecoder
from tega_learn.logs import PracticeRecord, read_tracked
from tega_practice.tracking import Curve, keep_tracked, tracked_samples


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
    # Another day: trained on the first, ten seconds of the new one put all to it, and the rest is judged.
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
