"""Comparison of the bench's positive controls: people are their own controls, and a verdict needs its margin."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from tega_figures.information.compare import Paired, paired, power_text
from tega_figures.information.controls import CELLS, CONTROLS, SOFTEST, table_text
from tega_figures.information.sessions import (
    MARGIN,
    OUTCOMES,
    BenchSession,
    LiftOutcome,
    outcomes,
    pairs,
    verdict,
)
from tega_figures.world.feasible import FAILURES, Grip, LevelOutcome, counts
from tega_sim.conditions import Condition
from tega_sim.operator import draw_person


def session(
    seed: int, condition: Condition, *slid_mm: float, name: str = "soft-bag", harmed: int = 0
) -> BenchSession:
    return BenchSession(
        seed=seed,
        object=name,
        view="hidden",
        condition=condition,
        rules=2,
        people="0",
        lifts=[LiftOutcome(slid, slid < 30, slid >= 30, 1, harmed, 2.5, 12.0) for slid in slid_mm],
    )


def test_outcomes_are_means_over_lifts_with_the_person_s_own_weights() -> None:
    grip = draw_person(3).grip
    slid, lost, slips, harm, effort, cost = outcomes(session(3, "oracle", 30.0, 10.0, harmed=2))
    assert (slid, lost, slips, harm, effort) == (20.0, 0.5, 1.0, 1.0, 0.5)
    assert cost == pytest.approx(1.0 + grip.harm_cost + 0.5 * grip.effort_cost)


def test_arms_are_compared_within_people_on_the_same_object() -> None:
    sessions = [session(seed, "non-haptic", 20.0 + seed) for seed in range(1, 6)]
    # Each slid 5 mm less, told in another order; one was never run without a vest, another on another object.
    sessions += [session(seed, "oracle", 15.0 + seed) for seed in (3, 1, 2, 5, 4, 9)]
    sessions += [session(1, "oracle", 0.0, name="soft-bottle")]
    told, off = pairs(sessions, view="hidden", condition="oracle", name="soft-bag")
    assert (told - off)[:, 0].tolist() == [-5.0] * 5
    lines = table_text(sessions).splitlines()
    assert "| soft-bag | hidden | `oracle` | 5 | -5.00 (-5.00 to -5.00) |" in lines[3]
    assert lines[3].endswith("| helps |")
    assert "soft-bottle" not in table_text(sessions), "nobody lifted it without a vest"


def test_a_control_s_interval_is_as_wide_as_its_many_tests_ask() -> None:
    arms: tuple[Condition, ...] = ("oracle", "haptic")
    sessions = [session(seed, "non-haptic", 20.0) for seed in range(5)]
    sessions += [session(seed, arm, 10.0 + seed) for arm in arms for seed in range(5)]
    rows = [line for line in table_text(sessions).splitlines() if "-8.00" in line]
    low = [float(row.split("(")[1].split(" to ")[0]) for row in rows]
    assert ["`oracle`" in row for row in rows] == [True, False]
    told = pairs(sessions, view="hidden", condition="haptic", name="soft-bag")
    found = [paired(*told, names=OUTCOMES, confidence=one) for one in (1 - 0.05 / 3, 0.95)]
    assert low == [round(one["slid"].low, 2) for one in found]
    assert low[0] < low[1]
    alone = pairs(sessions[:1], view="hidden", condition="non-haptic", name="soft-bag")
    assert paired(*alone, names=OUTCOMES)["slid"].high == np.inf


def test_a_verdict_is_of_the_pair_of_slide_and_harm() -> None:
    nothing = {what: Paired(0.0, -0.5 * MARGIN[what], 0.5 * MARGIN[what]) for what in OUTCOMES}
    less, more, wide = Paired(-5, -8, -2), Paired(0.3, 0.1, 0.5), Paired(0.0, -9.0, 9.0)
    assert verdict(nothing) == "null"
    assert verdict({**nothing, "slid": less}) == "helps"
    assert verdict({**nothing, "slid": less, "harm": more}) == "harms", "who squeezes more slips less"
    assert verdict({**nothing, "harm": more}) == "harms"
    assert verdict({**nothing, "slid": wide}) == "not told apart"


def test_the_design_s_objects_can_slip_and_be_harmed_and_its_arms_have_shams() -> None:
    assert [spec.stiffness_n_m for spec in SOFTEST.values()] == [1000.0, 800.0, 100.0]
    hidden = [condition for view, condition in CELLS if view == "hidden"]
    assert {"non-haptic", "mistimed", *CONTROLS} <= set(hidden)
    assert len(set(CELLS)) == len(CELLS)


def test_a_direction_counts_only_where_a_level_fails_and_another_does_not() -> None:
    def level(number: int, grip: Grip, *, harmed: bool = False) -> LevelOutcome:
        return LevelOutcome(
            object="bag", mass_kg=0.4, friction=0.5, stiffness_n_m=100.0, level=number, grip=grip, harmed=harmed,
            slid_mm=0.0, fastest_mm_s=0.0, narrowed_mm=0.0, seen_ms={}, slid_unseen_mm={},
        )  # fmt: skip

    def verdicts(*grips: Grip, harmed_from: int) -> list[bool]:
        levels = [level(n, grip, harmed=n >= harmed_from) for n, grip in enumerate(grips, start=2)]
        return [counts(levels, what) for what in FAILURES]

    assert verdicts("lost", "holds", "holds", "holds", harmed_from=5) == [True, True]
    assert verdicts("slips", "holds", "holds", "holds", harmed_from=6) == [True, False]
    assert verdicts("lost", "slips", "lost", "lost", harmed_from=5) == [False, True]
    assert verdicts("holds", "holds", "holds", "holds", harmed_from=2) == [False, False]


def test_power_says_what_could_have_been_seen_and_how_many_people_a_difference_asks_for() -> None:
    told = np.array([[0.0], [2.0]] * 8)
    text = power_text({"arm": (told, np.zeros_like(told))}, ["slips"])
    s, z = float(told.std(ddof=1)), 1.959964 + 0.841621
    cells = [cell.strip() for cell in text.splitlines()[-1].strip("|").split("|")]
    assert cells == ["arm", "slips", "16", "+1.000", f"{z * s / 4:.3f}", str(math.ceil((z * s) ** 2))]
