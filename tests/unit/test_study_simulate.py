"""A study in silico: the same whoever runs it, resumable, refused where it cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from tega.errors import InvalidValueError
from tega.study.silico import ensure_plan, simulate, unfinished
from tega.study.trials import study_trials


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"objects": ["moon"]}, "moon"),
        ({"conditions": ["haptic", "event-gated"]}, "event-gated"),
        ({"conditions": ["haptic", "unfelt"]}, "unfelt"),
        ({"shard": (3, 2)}, "3/2"),
    ],
)
def test_what_cannot_be_simulated_is_refused_before_anything_is_written(
    tmp_path: Path, settings: dict[str, list[str]], message: str
) -> None:
    with pytest.raises(InvalidValueError, match=message):
        simulate(tmp_path / "s", operators=1, **settings)  # type: ignore[arg-type]
    assert not (tmp_path / "s").exists()


def test_a_session_that_was_cut_short_is_run_again_to_the_same_bytes(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    plan = simulate(folder, operators=1, objects=["bag"], trials=1, jobs=1)
    whole = content(folder)
    assert unfinished(folder, plan) == []
    assert len(study_trials(folder)[1]) == 2
    assert len(whole) == 2 + 2 + 1 + 2 + 1  # plan, assumptions, events, two courses, a picture
    events = folder / "sessions" / "p01" / "events.jsonl"
    events.write_bytes(whole["sessions/p01/events.jsonl"][:300])
    assert unfinished(folder, plan) == ["p01"]
    simulate(folder, operators=1, objects=["bag"], trials=1, jobs=1)
    assert content(folder) == whole
    with pytest.raises(InvalidValueError, match="another plan"):
        simulate(folder, operators=2, objects=["bag"], trials=1, jobs=1)


@pytest.mark.deep
def test_shards_and_workers_give_the_same_study(tmp_path: Path) -> None:
    for name, jobs, shards in (("one", 1, [(1, 1)]), ("two", 2, [(1, 1)]), ("shards", 1, [(2, 2), (1, 2)])):
        for shard in shards:
            simulate(tmp_path / name, operators=2, objects=["bag"], trials=1, jobs=jobs, shard=shard)
    assert content(tmp_path / "one") == content(tmp_path / "two") == content(tmp_path / "shards")


def test_a_plan_is_written_once_and_found_again(tmp_path: Path) -> None:
    from tega.study import make_plan

    plan = make_plan(participants=2, simulated=True)
    ensure_plan(plan, tmp_path / "s")
    before = content(tmp_path / "s")
    ensure_plan(plan, tmp_path / "s")
    assert content(tmp_path / "s") == before
