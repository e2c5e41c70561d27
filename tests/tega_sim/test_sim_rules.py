"""The second version of the simulated person's rules: heeds a panel that follows the closure, and no other."""

from __future__ import annotations

from typing import Final

import numpy as np
import pytest

from reference.plant import Grasp, grasp, told_frame
from tega_sim.operator import Operator, draw_person, sham_vest, typical_person
from tega_sim.operator.belief import ConfirmedClosure
from tega_sim.operator.renewing import JudgingEyes, SettledGrip
from tega_sim.operator.vision import Kind, SeenEvent

SECOND: Final = 2


def closure() -> ConfirmedClosure:
    person = typical_person()
    return ConfirmedClosure(person.grip, person.vest.threshold)


def practised(slope: float, *, noise: float = 0.1) -> ConfirmedClosure:
    """Return what is believed after a panel was felt at known closures."""
    rng, belief = np.random.default_rng(4), closure()
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


def test_without_and_with_a_silent_vest_the_acts_are_the_same() -> None:
    """A check of plumbing: nothing but what is felt may differ."""

    def acts(name: str | None) -> object:
        vest = None if name is None else sham_vest(name)  # type: ignore[arg-type]
        return grasp(Operator(draw_person(4), seed=5, rules=SECOND), vest).acts

    assert acts(None) == acts("silent")
    assert acts("informative") == acts("permuted")


def test_practice_teaches_what_the_vest_shows_and_a_sham_teaches_distrust() -> None:
    def trust(name: str) -> float:
        operator, vest = Operator(draw_person(1), seed=1, rules=SECOND), sham_vest(name, seed=3)  # type: ignore[arg-type]
        operator.practise("object", lambda t_s, level: vest(t_s, told_frame(level)))
        belief = operator.beliefs["object"].closure
        assert isinstance(belief, ConfirmedClosure)
        return max(belief.trust("front"), belief.trust("back"))

    assert trust("informative") > 0.5
    assert trust("unrelated") < 0.05


def eyes(bears_m: float) -> JudgingEyes:
    person = typical_person()
    streams = {
        name: np.random.default_rng(n) for n, name in enumerate(("gaze", "looks", "poses", "reaction"))
    }
    return JudgingEyes(person.vision, bears_m=bears_m, width_m=0.1, **streams)


def test_a_dent_is_judged_when_it_has_grown_and_by_what_the_object_bears() -> None:
    looking = eyes(0.02)
    # A look whose chance would see anything: what is judged once is not judged again.
    assert looking._dented(0.1, 0.0)
    assert not any(looking._dented(0.1, 0.0) for _ in range(100))
    assert looking._dented(0.13, 0.0)
    # It eased, and grew anew.
    assert not looking._dented(0.05, 0.0)
    assert looking._dented(0.07, 0.0)
    # Half of the looks at what it bears, few at half of that; without a word about it, half at what can be seen.
    assert eyes(0.02)._seen(0.2, 0.2) == 0.5
    assert not eyes(0.02)._dented(0.1, 0.01)
    assert eyes(0.0)._dented(0.1, 0.5)


def test_what_a_command_has_not_changed_yet_is_not_answered() -> None:
    operator = Operator(typical_person(), seed=1, rules=3)
    operator.begin("object", width_m=0.07)
    assert operator._trial is not None
    grip = operator._trial.grip
    assert isinstance(grip, SettledGrip)

    def answered(kind: Kind, began_s: float) -> bool:
        return grip._answers(SeenEvent(began_s + 0.3, kind, began_s))

    grip._command(1.0, 3, "close")
    assert [answered("slip", at) for at in (0.9, 1.2, 1.7)] == [False, False, True]
    assert [answered("deformation", at) for at in (0.9, 1.2, 1.7)] == [False, True, True]
    grip._command(5.0, 2, "cost")
    assert [answered("slip", at) for at in (4.9, 5.2, 5.7)] == [False, True, True]
    assert [answered("deformation", at) for at in (4.9, 5.2, 5.7)] == [False, False, True]


def test_a_wall_gives_before_it_is_harmed() -> None:
    hard, giving = Grasp(2.4, 3.6), Grasp(2.4, 3.6, gives_from=1.5)
    assert hard.narrower_m(3.5) == 0.0
    assert 0 < giving.narrower_m(2.4) < giving.bears_m
    assert giving.narrower_m(4.01) > giving.bears_m
    assert hard.narrower_m(4.01) > hard.bears_m


def test_the_first_version_is_the_default() -> None:
    assert not isinstance(Operator(typical_person(), seed=1)._closure(), ConfirmedClosure)
