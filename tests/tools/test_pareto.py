"""The page of run time against error says what is committed, and its pictures can be read."""

from __future__ import annotations

from itertools import combinations

import pytest

from tega_figures.pareto.drawing import Choice, PricedVariant, drawn, front, table
from tega_figures.pareto.page import PAGE, SUBJECTS, kept, page

text_module = pytest.importorskip("matplotlib.text", reason="needs the extra tega[lab]")


def variant(name: str, cost: float, error: float, *, default: bool = False) -> PricedVariant:
    return PricedVariant(name=name, cost=cost, error=error, default=default)


def test_the_front_is_what_nothing_beats_in_both() -> None:
    cheap, good, worse, alike = (
        variant("cheap", 1, 9), variant("good", 5, 2), variant("worse", 6, 3), variant("alike", 5, 2),
    )  # fmt: skip
    assert front([good, worse, cheap, alike]) == [cheap, good, alike]


def test_a_table_marks_the_default_and_leaves_out_what_was_not_measured() -> None:
    choice = Choice(
        title="T", setting="`x`", cost="µs", error="%", how="So.", why="Because.",
        variants=[
            PricedVariant(name="a", cost=1.234, error=2, beside={"more": 3}),
            variant("b", 2, 3, default=True),
        ],
    )  # fmt: skip
    assert table(choice).splitlines()[2:] == [
        "| a | 1.23 | 2 | 3 | yes |",
        "| **b** (default) | 2 | 3 | – |  |",
    ]


def test_the_pages_say_what_is_committed() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text, kept()) == text, "python -m tega_figures.pareto.page --tables"


@pytest.mark.parametrize("name", SUBJECTS)
def test_every_subject_has_one_default_and_names_that_lie_apart(name: str) -> None:
    choice = kept().choices[name]
    assert sum(v.default for v in choice.variants) == 1
    (panel,) = drawn(choice).axes
    names = [text for text in panel.texts if isinstance(text, text_module.Annotation)]
    boxes = [text.get_window_extent() for text in names]
    assert len(boxes) == len(choice.variants)
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
