"""Comparison of the bench's positive controls: people are their own controls, and a verdict needs its margin."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from tega.sim.operator import draw_person
from tega_figures.information.compare import Paired
from tega_figures.information.controls import CELLS, CONTROLS, SOFTEST, table_text
from tega_figures.information.sessions import (
    MARGIN,
    OUTCOMES,
    BenchSession,
    LiftOutcome,
    differences,
    outcomes,
    verdict,
)
from tega_figures.world.feasible import Closure, counts


def session(
    seed: int, condition: str, *slid_mm: float, name: str = "soft-bag", harmed: int = 0
) -> BenchSession:
    return BenchSession(
        seed=seed,
        object=name,
        view="hidden",
        condition=condition,  # type: ignore[arg-type]
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
    found = differences(sessions, view="hidden", condition="oracle", name="soft-bag")
    assert found["slid"] == pytest.approx((-5.0, -5.0, -5.0))
    assert found["harm"] == pytest.approx((0.0, 0.0, 0.0))
    wider = [
        differences([*sessions, session(7, "non-haptic", 9.0), session(7, "oracle", 1.0)], view="hidden",
                    condition="oracle", name="soft-bag", confidence=confidence)["slid"]
        for confidence in (0.95, 1 - 0.05 / 3)
    ]  # fmt: skip
    assert wider[1].low < wider[0].low < wider[0].mean < wider[0].high < wider[1].high
    lines = table_text(sessions).splitlines()
    assert "| soft-bag | hidden | `oracle` | 6 | -5.00 (-5.00 to -5.00) |" in lines[3]
    assert lines[3].endswith("| helps |")


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


def test_a_direction_counts_only_where_a_closure_fails_and_another_does_not() -> None:
    def closures(*kinds: str) -> list[Closure]:
        return [
            Closure(
                object="bag", mass_kg=0.4, friction=0.5, stiffness_n_m=100.0, level=level, slid_mm=0.0,
                grip=kind.partition("+")[0], harmed="+" in kind, fastest_mm_s=0.0, narrowed_mm=0.0,  # type: ignore[arg-type]
                seen_ms={}, slid_unseen_mm={},
            )
            for level, kind in zip((2, 3, 4, 5), kinds, strict=True)
        ]  # fmt: skip

    def verdicts(*kinds: str) -> tuple[bool, bool]:
        found = closures(*kinds)
        return counts(found, "slips"), counts(found, "harm")

    assert verdicts("lost", "holds", "holds", "holds+harm") == (True, True)
    assert verdicts("slips", "holds", "holds", "holds") == (True, False)
    assert verdicts("lost", "slips", "lost", "lost+harm") == (False, True)
    assert verdicts("holds+harm", "holds+harm", "holds+harm", "holds+harm") == (False, False)
    assert np.all([counts(closures("lost", "holds", "holds", "holds"), "slips")])
