"""An object is carried to the second mark, or filled in the hand."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from tega.errors import InvalidValueError
from tega_sim.filling import HOLD_S, PORTION_N, Filling
from tega_sim.operator.motor import AWAY_M
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.score import ON_MARK_M
from tega_sim.trial import run_trial
from tega_sim.world import World

pytest.importorskip("mujoco")


def tried(**fields: Any) -> TrialResult:
    plan = {"object": "bag", "condition": "non-haptic", "seed": 3, "operator": "scripted", **fields}
    return run_trial(TrialPlan.checked(plan))


@pytest.mark.slow
def test_an_object_is_carried_to_the_second_mark_and_stands_there_let_go_of() -> None:
    done = tried(task="place")
    assert done.off_mark_m is not None
    assert (done.placed, done.success, done.drops) == (True, True, 0)
    assert 0 <= done.off_mark_m < ON_MARK_M < AWAY_M
    assert msgspec.json.decode(msgspec.json.encode(done), type=TrialResult) == done
    lost = tried(task="place", friction=0.25, mass_kg=0.8)  # it slides out of the hand on its way
    assert (lost.placed, lost.success) == (False, False)
    assert lost.off_mark_m is not None


@pytest.mark.slow
def test_a_simulated_person_places_an_object_and_a_lift_without_a_second_mark_says_nothing_of_one() -> None:
    person = tried(object="container", operator="simulated", task="place")
    assert person.placed
    assert person.duration_s > 15
    lift = tried()
    assert (lift.success, lift.placed, lift.off_mark_m) == (True, None, None)
    with pytest.raises(InvalidValueError, match="task"):
        tried(task="throw")


def test_portions_come_while_the_object_is_held_and_stay() -> None:
    filling = Filling(4)
    assert filling.force_n(3.0, holding=False) == 0.0
    weights = [filling.force_n(5.0 + 0.01 * n, holding=True) for n in range(round(100 * HOLD_S))]
    assert weights == sorted(weights)
    assert {round(weight / PORTION_N, 9) for weight in weights} == set(range(16))
    assert filling.force_n(5.0 + HOLD_S, holding=False) == weights[-1] == pytest.approx(15 * 0.1 * 9.81)
    assert filling.force_n(99.0, holding=False) == weights[-1]
    again, *others = (
        [other.force_n(5.0 + 0.01 * n, holding=True) for n in range(100)]
        for other in map(Filling, range(4, 8))
    )
    assert weights[:100] == again
    assert all(weights[:100] != other for other in others)


def test_a_push_bears_on_the_object_until_the_next() -> None:
    world = World("bag")
    for force_n in (6.0, 6.0, 0.0):
        world.push(force_n)
        assert world.data.xfrc_applied[:, 2].sum() == pytest.approx(-force_n)
    for force_n in (-1.0, math.nan, math.inf):
        with pytest.raises(InvalidValueError, match="force_n"):
            world.push(force_n)


@pytest.mark.slow
def test_a_grip_that_lifts_the_container_loses_it_when_it_is_filled() -> None:
    lifted, lost, kept = (
        tried(object="container", mass_kg=0.35, task=task, friction=friction)
        for task, friction in (("lift", 0.7), ("fill", 0.7), ("fill", 1.4))
    )
    assert [one.success for one in (lifted, lost, kept)] == [True, False, True]
    assert kept.duration_s > lifted.duration_s + 5
