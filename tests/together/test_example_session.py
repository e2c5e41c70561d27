"""The recorded lift of ``examples/`` opens in every verb that takes a recording; a lift is recorded as it was."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reference.command import call

pytest.importorskip("foxglove", reason="needs the extra record")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/recorded-lift"

pytestmark = pytest.mark.skipif(not EXAMPLE.is_dir(), reason="not a checkout")

FINGERS = {"thumb", "index", "middle", "ring"}
MOST_BYTES = 3_000_000


def reported(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    return call(capsys, *words)[0]


def test_the_example_is_small_enough_to_be_kept() -> None:
    assert sum(file.stat().st_size for file in EXAMPLE.iterdir()) < MOST_BYTES


def test_the_example_is_looked_into_and_computed_again(capsys, tmp_path):
    (trial,) = json.loads(reported(capsys, "inspect", EXAMPLE, "--json"))
    topics = {stream["topic"] for stream in trial["streams"]}
    assert {f"/tactile/{finger}/image" for finger in FINGERS} | {"/emg/samples", "/vest/frame"} <= topics
    (again,) = json.loads(reported(capsys, "replay", EXAMPLE, "--json"))
    assert again["same"]
    assert {s["stream"] for s in again["streams"]} >= {"/vest/frame", "/hand/frames", "/touch/event"}
    reported(capsys, "export", EXAMPLE, "--out", tmp_path / "tables")
    rows = next((tmp_path / "tables").rglob("vest.frame.csv")).read_text().splitlines()
    assert len(rows) > 100


@pytest.mark.slow
def test_a_recorded_demo_is_the_same_when_computed_again(capsys, tmp_path):
    pytest.importorskip("mujoco", reason="needs the extra sim")
    session = tmp_path / "session"
    words = ("--fast", "--objects", "bag", "--operator", "scripted", "--out", tmp_path / "demo")
    reported(capsys, "demo", *words, "--record", session, "--json")
    (again,) = json.loads(reported(capsys, "replay", session, "--json"))
    assert again["same"]
    assert again["complete"]
