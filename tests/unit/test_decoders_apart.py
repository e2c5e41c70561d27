"""The page tells how far a decoder beside is from the connected one, and its button undoes the adaptation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tega.bus import Bus
from tega.config import check_tree
from tega.records import Adaptation, BesideIntent, Button, Intent
from tega.teleop import run_session
from tega.view.browser.decoders_apart import DecodersApart
from tega.view.browser.feed import SessionFeed
from tega.view.state import ViewState


def told(apart: DecodersApart, pairs: list[tuple[float, float]], *, late_ns: int = 0) -> None:
    for k, (ours, theirs) in enumerate(pairs):
        apart.connected(Intent(t_ns=k * 100_000_000, level=1, closure=ours))
        apart.beside(BesideIntent(stage="rules", t_ns=k * 100_000_000 + late_ns, level=1, closure=theirs))


def test_closures_apart_by_more_than_half_a_level_are_counted_over_ten_seconds() -> None:
    apart = DecodersApart()
    told(apart, [(0.0, 1.0)] * 50 + [(0.5, 0.6)] * 75 + [(0.5, 0.75)] * 25)
    assert apart.rows() == {"beside rules": "closure 0.75 (connected 0.50), apart in 25 % of 10 s"}


def test_blocks_of_other_lengths_are_paired_by_their_times() -> None:
    apart = DecodersApart()
    told(apart, [(0.5, 0.5)] * 20, late_ns=-40_000_000)
    assert apart.rows()["beside rules"].endswith("apart in 0 % of 10 s")


def test_nothing_is_told_before_both_have_said_something() -> None:
    apart = DecodersApart()
    apart.beside(BesideIntent(stage="rules", t_ns=0, level=3))
    assert apart.rows() == {}


def test_a_run_that_is_looked_at_has_its_decoders_beside_without_a_recording(tmp_path: Path) -> None:
    tree = {
        "session": {"pace": "fast", "duration_s": 3.0},
        "emg": {"driver": "synthetic-emg", "kind": "raw"},
        "stages": {"beside": [{"group": "decoder", "name": "proportional"}]},
    }
    bus, rows = Bus(), list[Any]()
    feed = SessionFeed({}, bus)
    run_session(
        check_tree(tree, {}, base=tmp_path).config,
        on_prepared=feed.watch,
        observer=lambda loop: rows.append(feed.complete(ViewState(loop.t_ns, loop)).rows),
        bus=bus,
    )
    assert "apart in" in rows[-1]["beside proportional"]


def test_the_pages_button_presses_the_key_that_undoes() -> None:
    bus, pressed = Bus(), list[Button]()
    feed = SessionFeed({}, bus)
    bus.subscribe(Button, pressed.append)
    feed.undo()
    assert [(one.seat, one.pressed) for one in pressed] == [("undo", True)]
    bus.publish(Adaptation(t_ns=0, n_samples=1, why="rest", gains=(1.04, 1.0), offsets=(0.0, 0.0)))
    assert feed.adaptation_row() == {"adaptation": "gains 1.04 · 1.00 (rest)"}
