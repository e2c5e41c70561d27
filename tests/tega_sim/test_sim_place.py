"""The task of two places on the simulated bench: carried to the second mark and put down there."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

pytest.importorskip("mujoco")

from tega.errors import InvalidValueError
from tega_sim.operator.forearm import AWAY_M
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.score import ON_MARK_M
from tega_sim.trial import run_trial


def tried(**fields: Any) -> TrialResult:
    plan = {"object": "bag", "condition": "non-haptic", "seed": 3, "operator": "scripted", **fields}
    return run_trial(TrialPlan.checked(plan))


def test_an_object_is_carried_to_the_second_mark_and_stands_there_let_go_of() -> None:
    done = tried(task="place")
    assert done.off_mark_m is not None
    assert (done.placed, done.success, done.drops) == (True, True, 0)
    assert 0 <= done.off_mark_m < ON_MARK_M < AWAY_M
    assert msgspec.json.decode(msgspec.json.encode(done), type=TrialResult) == done


def test_what_slides_out_of_the_hand_on_its_way_is_not_placed() -> None:
    lost = tried(task="place", friction=0.25, mass_kg=0.8)
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
