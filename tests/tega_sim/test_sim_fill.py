"""The task of a container that is filled while it is held."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("mujoco")

from tega.errors import InvalidValueError
from tega_sim.filling import HOLD_S, PORTION_N, Filling
from tega_sim.plan import TrialPlan
from tega_sim.trial import run_trial
from tega_sim.world import OBJECTS, World


def test_portions_come_while_the_object_is_held_and_stay() -> None:
    filling = Filling(4)
    assert filling.force_n(3.0, holding=False) == 0.0
    weights = [filling.force_n(5.0 + 0.01 * n, holding=True) for n in range(round(100 * HOLD_S))]
    assert weights == sorted(weights)
    assert {round(weight / PORTION_N, 9) for weight in weights} == set(range(16))
    assert filling.force_n(5.0 + HOLD_S, holding=False) == weights[-1] == pytest.approx(15 * 0.1 * 9.81)
    assert filling.force_n(99.0, holding=False) == weights[-1]


def test_the_first_portions_time_is_the_seeds() -> None:
    def first_s(seed: int) -> float:
        filling = Filling(seed)
        return next(0.01 * n for n in range(100) if filling.force_n(0.01 * n, holding=True))

    assert first_s(1) == first_s(1)
    assert len({first_s(seed) for seed in range(5)}) > 1


@pytest.mark.parametrize("shell", ["pads", "flex"])
def test_a_push_bears_on_the_object_until_the_next(shell: str) -> None:
    bag = OBJECTS["bag"].with_(shell=shell, stiffening_n_m3=0.0, plastic_share=0.0)
    world = World(bag)
    for force_n in (6.0, 6.0, 0.0):
        world.push(force_n)
        assert world.data.xfrc_applied[:, 2].sum() == pytest.approx(-force_n)
    for force_n in (-1.0, math.nan, math.inf):
        with pytest.raises(InvalidValueError, match="force_n"):
            world.push(force_n)


def test_a_grip_that_lifts_the_container_loses_it_when_it_is_filled() -> None:
    def scripted(task: str, friction: float) -> tuple[bool, float]:
        fields = {"object": "container", "condition": "non-haptic", "seed": 3, "operator": "scripted"}
        plan = TrialPlan.checked({**fields, "task": task, "mass_kg": 0.35, "friction": friction})
        done = run_trial(plan)
        return done.success, done.duration_s

    assert scripted("lift", 0.7)[0]
    assert not scripted("fill", 0.7)[0]
    kept, duration_s = scripted("fill", 1.4)
    assert kept
    assert duration_s > scripted("lift", 0.7)[1] + 5
