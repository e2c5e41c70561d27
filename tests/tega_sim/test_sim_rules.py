"""The simulated person's rules: heeds a panel that follows the closure, and no other, and answers what has changed."""

from __future__ import annotations

import numpy as np
import pytest

from reference.plant import grasp, told_frame
from tega_sim.conditions import sham_vest
from tega_sim.operator import Operator, draw_person, typical_person
from tega_sim.operator.belief import Closure
from tega_sim.operator.vision import Kind, SeenEvent


def practised(slope: float, *, noise: float = 0.1) -> Closure:
    """Return what is believed after a panel was felt at known closures."""
    rng, person = np.random.default_rng(4), typical_person()
    belief = Closure(person.grip, person.vest.threshold)
    for _ in range(4):
        for level in (2.0, 3.0, 4.0, 5.0):
            belief.set(level, 0.04)
            belief.feel("front", -0.8 + slope * (level - 3) + noise * float(rng.standard_normal()), 0.04)
    return belief


@pytest.mark.parametrize("slope", [0.8, -0.8])
def test_a_panel_that_follows_the_closure_is_trusted_and_then_moves_the_belief(slope: float) -> None:
    belief = practised(slope)
    assert belief.trust("front") > 0.8
    assert belief.trust("back") < 0.06
    assert belief.slope("front") * slope > 0
    belief.set(3.0, 0.15)
    belief.feel("front", -0.8 + slope * 0.5, 0.04, fresh=False)
    assert 3.15 < belief.x < 3.6
    assert belief.var < 0.15


def test_a_panel_that_goes_its_own_way_is_not_trusted_and_moves_nothing() -> None:
    belief = practised(0.0, noise=0.8)
    assert belief.trust("front") < 0.05
    belief.set(3.0, 0.15)
    belief.feel("front", -1.5, 0.04, fresh=False)
    assert belief.x == pytest.approx(3.0, abs=0.03)


def test_what_is_felt_long_after_a_command_changes_the_closure_and_not_the_curve() -> None:
    belief = practised(0.8)
    before = belief._mean[1:].copy()
    belief.set(3.0, 0.15)
    belief.feel("front", -1.2, 0.04, fresh=False)
    assert np.array_equal(belief._mean[1:], before)
    assert belief.x < 2.9


def test_practice_teaches_what_the_vest_shows_and_a_sham_teaches_distrust() -> None:
    def practised(name: str, who: int = 1) -> tuple[float, object]:
        """Return how far the better panel is trusted, and what is done then."""
        operator, vest = Operator(draw_person(who), seed=who), sham_vest(name, seed=3)  # type: ignore[arg-type]
        operator.practise("object", lambda t_s, level: vest(t_s, told_frame(level)))
        closure = operator.beliefs["object"].closure
        trust = max(closure.trust("front"), closure.trust("back"))
        return trust, grasp(operator, vest).acts

    trusted, acts = practised("informative")
    assert trusted > 0.5
    assert practised("unrelated")[0] < 0.05
    # Which finger vibrates changes nothing, whether one does a good deal.
    assert practised("permuted") == (trusted, acts)
    assert practised("silent", 3)[1] != practised("informative", 3)[1]


def test_what_a_command_has_not_changed_yet_is_not_answered() -> None:
    operator = Operator(typical_person(), seed=1)
    operator.begin("object", width_m=0.07)
    assert operator._trial is not None
    grip = operator._trial.grip

    def answered(kind: Kind, began_s: float) -> bool:
        return not grip._precedes(SeenEvent(began_s + 0.3, kind, began_s))

    grip._command(1.0, 3, "close")
    assert [answered("slip", at) for at in (0.9, 1.2, 1.7)] == [False, False, True]
    assert [answered("deformation", at) for at in (0.9, 1.2, 1.7)] == [False, True, True]
    grip._command(5.0, 2, "cost")
    assert [answered("slip", at) for at in (4.9, 5.2, 5.7)] == [False, True, True]
    assert [answered("deformation", at) for at in (4.9, 5.2, 5.7)] == [False, False, True]
