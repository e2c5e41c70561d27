"""Arms of a study: each within the people who were under all, tests corrected together, effects of both factors."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco")

from tega_figures.information.arms import by_person, holm, table_text
from tega_figures.information.sessions import OUTCOMES, BenchSession, LiftOutcome
from tega_sim.conditions import Condition
from tega_sim.operator import draw_person

# What each arm changes in the way slid, mm: 1 by the vest, 2 by the reflex, and 4 more by both together.
SLID: dict[Condition, float] = {
    "non-haptic": 0.0,
    "haptic": 1.0,
    "reflex": 2.0,
    "haptic-reflex": 7.0,
    "oracle": 0.0,
}


def session(seed: int, condition: Condition, *, lost: bool = False) -> BenchSession:
    lift = LiftOutcome(10.0 + 0.1 * seed + SLID[condition], not lost, lost, 0, 0, 3.0, 15.0)
    return BenchSession(
        seed=seed, object="bag", view="hidden", condition=condition, rules=3, people="", lifts=[lift]
    )


def test_arms_are_compared_within_those_who_were_under_all_of_them() -> None:
    sessions = [session(seed, arm) for seed in (1, 2, 3) for arm in SLID]
    sessions.append(session(4, "haptic"))  # cut short: nothing without a vest
    arms = by_person(sessions)
    assert next(iter(arms)) == "non-haptic"
    assert {len(rows) for rows in arms.values()} == {3}
    slid, effort, cost = OUTCOMES.index("slid"), OUTCOMES.index("effort"), OUTCOMES.index("cost")
    assert (arms["haptic-reflex"] - arms["non-haptic"])[:, slid] == pytest.approx([7.0] * 3)
    weights = [draw_person(seed).grip.effort_cost for seed in (1, 2, 3)]
    assert arms["oracle"][:, cost] == pytest.approx([weight * 0.6 for weight in weights])
    assert arms["oracle"][:, effort] == pytest.approx([0.6] * 3)


def test_the_table_has_each_arm_the_effects_of_vest_and_reflex_and_each_arm_s_tests_once() -> None:
    def study(arms: list[Condition]) -> list[BenchSession]:
        people = range(1, 13)
        return [
            session(seed, arm, lost=arm == "non-haptic" and seed % 3 > 0) for seed in people for arm in arms
        ]

    text = table_text([study(["haptic", "non-haptic", "oracle"]), study([*SLID])])
    # The vest adds 1 without a reflex and 5 with one, the reflex 2 and 6; together 4 beyond the sum.
    assert "| the vest | 12 | +3.000 (+3.000 to +3.000)" in text
    assert "| the reflex | 12 | +4.000 (+4.000 to +4.000)" in text
    assert "| both beyond each | 12 | +4.000 (+4.000 to +4.000)" in text
    # Two of three are lost without a vest, nobody's lift under the others: t = 4.69 of 11, three of six tests so.
    assert text.count(", lost | -0.667 | 0.001 | 0.004 |") == 3
    assert text.count(", cost | +0.000 | 1.000 | 1.000 |") == 3
    assert text.count("control: `oracle`, lost | -0.667 | 0.001 |") == 1


def test_p_values_are_corrected_by_holm() -> None:
    # Steps 0.005 x 4, 0.01 x 3, 0.03 x 2 and 0.04 x 1, the last held up by the one before.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
