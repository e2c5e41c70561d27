"""The table of films of two places on docs/evidence/scene.md is made of the committed results."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

pytest.importorskip("cv2")
pytest.importorskip("mujoco")
pytest.importorskip("scipy")

from tega_figures.scene import places
from tega_figures.scene.prove import ProvenTrial

ROOT = Path(__file__).parents[2]


def test_the_tables_of_other_people_are_those_of_the_results() -> None:
    folder = Path(places.__file__).parent
    put = [
        msgspec.json.decode(line, type=places.PlacedTrial)
        for line in (folder / "places-50.jsonl").read_bytes().splitlines()
    ]
    lifted = [
        msgspec.json.decode(line, type=ProvenTrial)
        for line in (folder / "lifts-3.jsonl").read_bytes().splitlines()
    ]
    page = (ROOT / "docs/evidence/scene.md").read_text(encoding="utf-8")
    assert places.table(put).partition("\n\n")[0] in page
    for one in lifted:
        assert f"| {one.name} | {one.rate_hz:.0f} | {one.film} |" in page
    said = places.together([*put, *lifted])
    assert "27 trials" in said
    assert "F1 0.994 (0.983 to 1.000), 89 of 89 true events, 1 more; 9 ms off in the mean, 40 at most" in said
    assert "**F1 0.994**, 95 % from 0.983 to 1.000" in page


def test_the_table_is_that_of_the_results() -> None:
    kept = Path(places.__file__).with_name("places.jsonl").read_bytes().splitlines()
    trials = [msgspec.json.decode(line, type=places.PlacedTrial) for line in kept]
    assert [one.name for one in trials] == [
        f"{plan.object} {plan.condition} {plan.seed}" for plan, *_ in places.design(40)
    ]
    table, _, said = places.table(trials).partition("\n\n")
    page = (ROOT / "docs/evidence/scene.md").read_text(encoding="utf-8")
    assert table in page
    assert "put where: 0.77 mm over all, 1.36 in the worst" in said
    assert "F1 0.959" in said
    assert "**F1 0.959**" in page
