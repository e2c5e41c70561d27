"""Stages chosen in a replay, of sessions and of loose files, and those beside the connected ones compared again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.sessions import synthetic
from tega.config import load_config

BESIDE = """
[[stages.beside]]
group = "metric"
name = "live"
options = { outline = "contact" }
[[stages.beside]]
group = "decoder"
name = "rules"
options = { fusion = "median" }
"""
TOPICS = {"/beside/live/index", "/beside/rules/emg"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a short session with a metric and a decoder beside."""
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    from tega.loop import run_session

    folder = tmp_path_factory.mktemp("session")
    (folder / "lab.toml").write_text(synthetic(4.0, "index", more=BESIDE))
    summary = run_session(load_config(folder / "lab.toml", environ={}).config)
    return folder / "recorded" / str(summary["recording"]["file"])


def replayed(*words: object, capsys: Any, code: int = 0) -> Any:
    return json.loads(call(capsys, "replay", *words, "--json", code=code)[0])


def test_what_stages_beside_said_is_compared_again(recording: Path, capsys: Any) -> None:
    (replay,) = replayed(recording, capsys=capsys)
    streams = {stream["stream"]: stream for stream in replay["streams"] if "/beside/" in stream["stream"]}
    assert streams.keys() == TOPICS
    assert all(stream["recorded"] > 10 and stream["differ"] == 0 for stream in streams.values())


def test_a_stage_beside_that_says_something_else_is_found(recording: Path, capsys: Any) -> None:
    other = (
        'stages.beside=[{group="metric",name="live"},{group="decoder",name="rules",options={intervals=5}}]'
    )
    (replay,) = replayed(recording, "--set", other, capsys=capsys, code=1)
    differ = {stream["stream"] for stream in replay["streams"] if stream["differ"]}
    assert differ == TOPICS


def test_a_session_is_replayed_through_another_stage(recording: Path, capsys: Any) -> None:
    sets = (
        "stages.metric.name=reading",
        "stages.metric.options.threshold=D8",
        "stages.mapping.options.law=logistic",
    )
    words = [word for item in sets for word in ("--set", item)]
    (replay,) = replayed(recording, *words, capsys=capsys, code=1)
    assert any(
        "stages.metric: live" in text and "reading (threshold D8" in text for text in replay["changed"]
    )
    assert any("law logistic" in text for text in replay["changed"])
    assert next(s for s in replay["streams"] if s["stream"] == "/tactile/index/contact")["differ"] > 0
    assert next(s for s in replay["streams"] if s["stream"] == "/emg/levels")["differ"] == 0
    wrong = "--set", "stages.metric.options.outlin=dent"
    assert "did you mean 'outline'" in call(capsys, "verify", recording, *wrong, code=1)[1]


def test_loose_files_are_replayed_through_a_stage(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tega.ui.view.course.SessionPicture.write", lambda *_given, **_more: None)
    samples = np.random.default_rng(1).standard_normal((1000, 3)) * np.repeat([0.1, 1.0], 500)[:, None]
    np.save(tmp_path / "squeeze.npy", samples)
    words = ["--emg-rate-hz", "250", "--emg-kind", "raw", "--preset", "paper"]
    words += ["--emg", str(tmp_path / "squeeze.npy")]
    levels = []
    for name, sets in (("a", ()), ("b", ("--set", "stages.decoder.options.tau_s=0.2"))):
        replayed(*words, *sets, "--out", tmp_path / name, capsys=capsys)
        levels.append((tmp_path / name / "levels.csv").read_text().splitlines())
    assert len(levels[0]) - 1 == 2 * (len(levels[1]) - 1)
    wrong = "--out", tmp_path / "c", "--set", "stages.decoder.options.tu_s=1"
    assert "did you mean 'tau_s'" in call(capsys, "replay", *words, *wrong, code=1)[1]


MAPPINGS = ("slip-row", "equal-steps", "changes", "place")


@pytest.mark.slow
@pytest.mark.parametrize("mapping", MAPPINGS)
def test_a_session_with_a_mapping_of_felt_steps_changes_or_places_is_replayed(mapping, tmp_path, capsys):
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    from tega.loop import run_session

    plain = synthetic(4.0, "index")
    (tmp_path / "lab.toml").write_text(
        f"{plain}[vest]\nthreshold = 24.0\nstep = 7.0\n[stages.mapping]\nname = '{mapping}'\n"
    )
    summary = run_session(load_config(tmp_path / "lab.toml", environ={}).config)
    file = tmp_path / "recorded" / str(summary["recording"]["file"])
    (replay,) = replayed(file, capsys=capsys)
    vest = next(stream for stream in replay["streams"] if stream["stream"] == "/vest/frame")
    assert (vest["recorded"] > 100, vest["differ"]) == (True, 0)
    # Through the columns it differs: what is compared above was the mapping's own.
    (other,) = replayed(file, "--set", "stages.mapping.name=columns", capsys=capsys, code=1)
    differ = {stream["stream"] for stream in other["streams"] if stream["differ"]}
    assert "/vest/frame" in differ
