"""The stress cases keep their bounds, and their references agree with the ones of the other tests."""

from __future__ import annotations

import json
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from reference import emg as reference_emg
from reference import tactile as reference_tactile
from tega.cli.main import main
from tega_campaigns.stress import GROUPS, StressCase, render_page
from tega_campaigns.stress.exact_emg import dc_gain, design, filtered, gain_squared, transfer_function
from tega_campaigns.stress.exact_touch import exact_contact

PAGE = Path(__file__).resolve().parents[2] / "docs" / "stress.md"


@pytest.fixture(scope="module")
def cases() -> list[dict[str, Any]]:
    words = [sys.executable, "-W", "error", "-m", "tega.cli", "stress", "--quick", "--json"]
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr + ran.stdout
    found: list[dict[str, Any]] = json.loads(ran.stdout)
    return found


def test_every_case_keeps_its_bound(cases) -> None:
    assert [
        c["name"] for c in cases if not c["passed"] or c["error"] is None or c["error"] > c["bound"]
    ] == []


def test_every_group_has_cases_and_no_name_stands_twice(cases) -> None:
    assert {c["group"] for c in cases} == set(GROUPS)
    names = [(c["group"], c["name"]) for c in cases]
    assert len(set(names)) == len(names)


def test_the_page_tells_of_every_case(cases) -> None:
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    told = {row.split("|")[1].strip() for row in rows} - {"case"}
    assert told == {c["name"].replace("1e6 samples", "1e8 samples") for c in cases}
    assert "missed" not in PAGE.read_text(encoding="utf-8").lower()


def test_a_missed_bound_is_told() -> None:
    case = StressCase(
        group="emg",
        name="n",
        done="d",
        happened="a | b",
        error=2e-3,
        bound=1e-3,
        error_of="share of full scale",
    )
    assert not case.passed
    assert "| n | d | a \\| b | **2e-03: missed** | 0.001 | share of full scale |" in render_page([case])


def test_a_false_claim_is_a_miss_whatever_the_error() -> None:
    case = StressCase(
        group="emg", name="n", done="", happened="", error=0.0, bound=1.0, error_of="", holds=False
    )
    assert not case.passed


def test_two_kinds_of_output_at_once_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["stress", "--quick", "--json", "--markdown"])
    assert ended.value.code == 2
    assert "exclude each other" in capsys.readouterr().err


@pytest.mark.parametrize("spread", ["spatial", "intensity"])
@pytest.mark.parametrize("difference", ["signed", "rectified", "absolute"])
@pytest.mark.parametrize("weights", [(0.299, 0.587, 0.114), (2.0, -1.5, 0.5)])
def test_the_exact_contact_agrees_with_pixel_by_pixel_fractions(weights, difference, spread) -> None:
    rng = np.random.default_rng(11)
    contacts = 0
    for _ in range(6):
        frame, baseline = (
            rng.integers(110, 256, (7, 9, 3), np.uint8),
            rng.integers(0, 130, (7, 9, 3), np.uint8),
        )
        grey = reference_tactile.grey_map(frame, baseline, weights, "bgr", difference)
        slow = reference_tactile.metrics_of_map(grey, spread=spread)
        fast = exact_contact(frame, baseline, weights=weights, difference=difference, spread=spread)
        assert (fast.in_contact, fast.mass, fast.peak) == (slow.in_contact, slow.mass, slow.peak)
        assert fast.peak_xy == slow.peak_xy
        if slow.in_contact:
            contacts += 1
            assert (fast.centroid_xy, fast.eda, fast.cci) == (slow.centroid_xy, slow.eda, slow.cci)
            assert slow.spread is not None
            assert slow.threshold is not None
            assert abs(fast.spread - slow.spread) < Fraction(1, 10**50)
            assert abs(fast.threshold - slow.threshold) < Fraction(1, 10**50)
    assert contacts > 0


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 8])
@pytest.mark.parametrize("rate_hz", [200.0, 1e3, 1e6])
def test_the_exact_filter_agrees_with_poles_in_complex_numbers(order: int, rate_hz: float) -> None:
    sections = sorted(design(rate_hz, 50.0, order), key=lambda s: s[4])
    wanted = reference_emg.butterworth_lowpass(rate_hz, 50.0, order)
    with mpmath.workdps(60):
        for got, true in zip(sections, wanted, strict=True):
            assert all(
                abs(mpmath.mpf(str(g)) - t) < mpmath.mpf(10) ** -45 for g, t in zip(got, true, strict=True)
            )
        samples = np.random.default_rng(12).normal(size=50).tolist()
        outputs = zip(filtered(sections, samples), reference_emg.filtered(wanted, samples), strict=True)
        assert all(abs(mpmath.mpf(str(g)) - t) < mpmath.mpf(10) ** -35 for g, t in outputs)


def test_the_exact_response_of_a_known_filter() -> None:
    # y[n] = (x[n] + x[n-1]) / 2: gain 1 at frequency 0, cos²(π f) elsewhere.
    mean = [[0.5, 0.5, 0.0, 1.0, 0.0, 0.0]]
    assert dc_gain(mean) == 1
    for share in (1e-6, 0.125, 0.25, 0.49):
        with mpmath.workdps(50):
            wanted = mpmath.cos(mpmath.pi * mpmath.mpf(share)) ** 2
            assert abs(mpmath.mpf(str(gain_squared(mean, share))) - wanted) < mpmath.mpf(10) ** -45


def test_the_fraction_is_the_sections_multiplied_out() -> None:
    sections = design(1e3, 50.0, 4)
    b, a = transfer_function(sections)
    x = 0.3
    floats = [[float(c) for c in s] for s in sections]
    by_sections = np.prod([(s[0] + s[1] * x + s[2] * x * x) / (1 + s[3] * x + s[4] * x * x) for s in floats])
    assert np.polyval(b[::-1], x) / np.polyval(a[::-1], x) == pytest.approx(by_sections, rel=1e-12)
