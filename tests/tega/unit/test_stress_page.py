"""The page of numerical stress has a line for every property, and a bound that is missed is told."""

from __future__ import annotations

import importlib
from fractions import Fraction
from pathlib import Path

import pytest

from reference import extremes
from reference.extremes import EXTREMES, GROUPS, Extreme, relative

PAGE = Path(__file__).resolve().parents[3] / "docs" / "evidence" / "installing.md"
for kernel in ("contact", "touch", "vest", "emg", "fraction", "decoders"):
    importlib.import_module(f"property.test_extremes_{kernel}")


def test_every_group_has_lines_and_no_name_stands_twice_on_the_page() -> None:
    assert {line.group for line in EXTREMES} == set(GROUPS)
    text = (
        PAGE.read_text(encoding="utf-8")
        .split("<!-- extremes: begin -->")[1]
        .split("<!-- extremes: end -->")[0]
    )
    rows = [row.split(" | ") for row in text.splitlines() if row.startswith("| ")][1:]
    reported = [row[1] for row in rows]
    assert len(set(reported)) == len(reported)
    assert set(reported) == {line.name for line in EXTREMES}
    # Errors are at most their bounds on the page as well.
    assert all(float(row[2]) <= float(row[3]) for row in rows)


def test_a_missed_bound_fails_and_an_untried_line_makes_no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extremes, "EXTREMES", [])
    line = Extreme("emg", "n", "a | b", 1e-3, "share of full scale")
    with pytest.raises(AssertionError, match=r"n: the error 0\.002 is beyond 0\.001"):
        line.hold(2e-3)
    with pytest.raises(ValueError, match="not tried"):
        extremes.extremes_table()
    line.hold(5e-4, "so it was")
    line.hold(1e-5, "so it was")
    assert "| EMG filter | n | 5e-04 | 0.001 | share of full scale; so it was |" in extremes.extremes_table()


def test_an_error_is_a_share_of_a_normal_number() -> None:
    assert relative(1.5, Fraction(1)) == 0.5
    assert relative(5e-324, Fraction(0)) < 1e-15
