"""The table of films of two places on docs/evidence/scene.md is made of the committed results."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

pytest.importorskip("cv2")
pytest.importorskip("mujoco")
pytest.importorskip("scipy")

from tega_figures.scene import places

ROOT = Path(__file__).parents[2]


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
