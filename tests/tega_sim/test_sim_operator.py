"""The simulated person: drawn from the file, believes what it saw, and gains nothing from shams."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from reference.plant import EXACT, Grasp, grasp, told_frame, with_
from tega.errors import ConfigError, InvalidValueError
from tega_sim.conditions import sham_vest
from tega_sim.operator import Operator, draw_person, load_parameters, typical_person
from tega_sim.operator.belief import Closure, above, below
from tega_sim.operator.person import stream
from tega_sim.operator.vision import Kind, SeenEvent
from tega_sim.seams import Percept, WorldTruth

STILL = WorldTruth(0.0, 0.0, False, (0.0,) * 4, 0.0, 0.0, 0.0, 0.0, False, 0.1)
FILE = Path(__file__).parents[2] / "python/tega_sim/operator/parameters.toml"


# --- parameters and population ---


def test_every_parameter_has_unit_mark_source_and_bounds_around_it() -> None:
    parameters = load_parameters()
    assert parameters.frozen
    for _, name, p in parameters:
        assert p.low <= p.value <= p.high
        assert p.source
        assert p.unit or name in {"rt_correlation", "exponent", "adapt_gain", "attempts", "power"}


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("lapse = {", "relapse = {", "lapse"),
        ("{ value = 215", "{ value = 15", "vision.rt_ms = 15.0 ms is not within 160.0 to 320.0"),
        ('mark = "A"', 'mark = "Z"', "Z"),
        ("[vision]", "[vision", "parameters"),
    ],
)
def test_a_parameter_file_that_is_not_right_is_refused(tmp_path: Path, old: str, new: str, text: str) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(FILE.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=text.replace(".", r"\.")):
        load_parameters(path)


def test_people_differ_as_the_file_says() -> None:
    parameters = load_parameters()
    people = [draw_person(seed, parameters) for seed in range(600)]
    assert people[0] == draw_person(0, parameters)
    for section, name, p in parameters:
        drawn = np.array([getattr(getattr(person, section), name) for person in people])
        if p.sd == 0:
            assert np.all(drawn == p.value)
            continue
        slower_ms = 0.55 * 35 if name == "rt_ms" else 0.0
        assert np.all((drawn >= p.low) & (drawn <= p.high + slower_ms))
        scores = np.log(drawn / p.value) / p.sd if p.law == "lognormal" else (drawn - p.value) / p.sd
        bounds = np.array([p.low, p.high])
        cut = (np.log(bounds / p.value) if p.law == "lognormal" else bounds - p.value) / p.sd
        assert np.mean(scores) == pytest.approx(stats.truncnorm.mean(*cut), abs=0.15)
        assert np.std(scores) == pytest.approx(stats.truncnorm.std(*cut), abs=0.12)
    times = np.array([(person.vision.rt_ms, person.vest.rt_ms) for person in people])
    assert np.corrcoef(times.T)[0, 1] == pytest.approx(0.6, abs=0.08)


# --- beliefs ---


@pytest.mark.parametrize(("x", "var"), [(2.0, 0.04), (3.5, 0.3), (5.0, 0.0)])
def test_learning_a_bound_gives_the_moments_of_the_cut_gaussian(x: float, var: float) -> None:
    def moment(k: int) -> float:
        def cut(need: float) -> float:
            share = stats.norm.cdf((need - x) / max(math.sqrt(var), 1e-9))
            return float(need**k * stats.norm.pdf(need, 3.0, 1.2) * share)

        return float(integrate.quad(cut, -6, 12, points=[x], limit=200)[0])

    mean = moment(1) / moment(0)
    sd = math.sqrt(moment(2) / moment(0) - mean**2)
    assert above(3.0, 1.2, x, var, 0.0) == pytest.approx((mean, sd), abs=1e-5)
    assert below(-3.0, 1.2, -x, var, 0.0) == pytest.approx((-mean, sd), abs=1e-5)


def test_beliefs_fade_between_trials_and_are_carried_to_another_object() -> None:
    operator = Operator(typical_person(), seed=1)
    operator.begin("heavy", width_m=0.07)
    operator.beliefs["heavy"].need = (5.0, 0.3)
    operator.begin("heavy", width_m=0.07, trial=1)
    assert operator.beliefs["heavy"].need == pytest.approx((5.0, math.hypot(0.3, 0.2)))
    operator.begin("light", width_m=0.07)
    assert operator.beliefs["light"].need == pytest.approx((3.0 + 0.3 * 2.0, 1.2))


# --- the whole person ---


def test_a_trial_goes_through_its_phases_and_lifts() -> None:
    outcome = grasp(Operator(EXACT, seed=2), None)
    phases = list(dict.fromkeys(act.phase for act in outcome.acts))
    assert phases == ["reach", "grasp", "lift", "hold", "place", "release", "done"]
    assert outcome.highest_m > 0.2
    assert not outcome.dropped
    assert outcome.acts[0].forearm_m == pytest.approx((0.0, 0.1))
    assert max(act.excitation for act in outcome.acts) <= 1.15


def test_the_same_seed_does_the_same_and_who_cannot_feel_the_vest_acts_as_if_there_were_none() -> None:
    def acts(seed: int, vest: Any = None, **how: Any) -> object:
        return grasp(Operator(draw_person(4), seed=seed, **how), vest).acts

    informative = sham_vest("informative")
    assert acts(1, informative) == acts(1, informative) != acts(2, informative)
    assert acts(5) == acts(5, informative, feels=False) == acts(5, sham_vest("silent"))


@pytest.mark.slow
def test_a_constant_vest_changes_nothing_but_what_false_alarms_do() -> None:
    def pair(name: str) -> tuple[float, float]:
        outcomes = []
        for seed in range(12):
            operator, vest = Operator(draw_person(seed), seed=seed), sham_vest(name, seed=seed)  # type: ignore[arg-type]
            outcomes += [grasp(operator, vest, trial=trial) for trial in range(3)]
        return float(np.mean([o.slips for o in outcomes])), float(np.mean([o.deformed for o in outcomes]))

    assert pair("constant") == pytest.approx(pair("off"), abs=0.1)


def test_heavy_things_are_held_firmly_and_fragile_ones_gently() -> None:
    watching = with_(EXACT, "vision", gaze_grasp=1.0, gaze_transport=1.0)
    held, beliefs = {}, {}
    for name, item in (("heavy", Grasp(need=3.5, harm=9)), ("fragile", Grasp(need=1.6, harm=2.4))):
        operator = Operator(watching, seed=2)
        outcomes = [grasp(operator, None, item=item, trial=trial) for trial in range(4)]
        acts = [act for outcome in outcomes for act in outcome.acts]
        held[name] = np.mean([act.excitation for act in acts if act.phase == "hold"])
        beliefs[name] = operator.beliefs["object"]
        # Half of the looks at what it bears see it: one deformation may pass unseen.
        assert [outcome.deformed for outcome in outcomes] == [name == "fragile"] * 2 + [False, False]
        assert all(outcome.highest_m > 0.2 for outcome in outcomes)
    assert held["heavy"] > 1.8 * held["fragile"]
    assert beliefs["heavy"].need[0] > 3.5 > beliefs["fragile"].need[0]
    assert beliefs["heavy"].harm[0] > 4.5 > beliefs["fragile"].harm[0]


def test_what_cannot_be_lifted_is_tried_three_times() -> None:
    outcome = grasp(Operator(EXACT, seed=1), None, item=Grasp(need=9, harm=99), seconds=40)
    phases = [act.phase for act in outcome.acts]
    starts = sum(a != "reach" and b == "reach" for a, b in itertools.pairwise(phases))
    assert starts == 2
    assert phases[-1] == "done"
    assert outcome.highest_m == 0


def test_time_that_goes_back_and_impossible_objects_are_refused() -> None:
    operator = Operator(typical_person(), seed=1)
    operator.act(Percept(1.0, STILL, None))
    with pytest.raises(InvalidValueError, match=r"t_s = 0\.5 s"):
        operator.act(Percept(0.5, STILL, None))
    with pytest.raises(InvalidValueError, match="width_m = 0 m"):
        operator.begin("thread", width_m=0)
    with pytest.raises(InvalidValueError, match="full_effort = -1"):
        Operator(typical_person(), seed=1, full_effort=-1)


def test_an_extra_draw_in_one_stream_changes_no_other() -> None:
    first, second = stream(7, "aim"), stream(7, "gaze")
    first.random(10)
    assert second.random() == stream(7, "gaze").random()


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
def test_a_panel_that_follows_the_closure_is_trusted_and_then_moves_the_belief_and_not_the_curve(
    slope: float,
) -> None:
    belief = practised(slope)
    curve = belief._mean[1:].copy()
    assert belief.trust("front") > 0.8
    assert belief.trust("back") < 0.06
    assert belief.slope("front") * slope > 0
    belief.set(3.0, 0.15)
    belief.feel("front", -0.8 + slope * 0.5, 0.04, fresh=False)
    assert 3.15 < belief.x < 3.6
    assert belief.var < 0.15
    assert np.array_equal(belief._mean[1:], curve)


def test_a_panel_that_goes_its_own_way_is_not_trusted_and_moves_nothing() -> None:
    belief = practised(0.0, noise=0.8)
    assert belief.trust("front") < 0.05
    belief.set(3.0, 0.15)
    belief.feel("front", -1.5, 0.04, fresh=False)
    assert belief.x == pytest.approx(3.0, abs=0.03)


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

    def answered(kind: Kind, at_s: float) -> list[bool]:
        """Return whether it is answered if it began before, just after, and long after a command."""
        times_s = (at_s - 0.1, at_s + 0.2, at_s + 0.7)
        return [not grip._precedes(SeenEvent(began_s + 0.3, kind, began_s)) for began_s in times_s]

    grip._command(1.0, 3, anew=True)
    assert (answered("slip", 1.0), answered("deformation", 1.0)) == (
        [False, False, True],
        [False, True, True],
    )
    grip._command(5.0, 2)
    assert (answered("slip", 5.0), answered("deformation", 5.0)) == (
        [False, True, True],
        [False, False, True],
    )
