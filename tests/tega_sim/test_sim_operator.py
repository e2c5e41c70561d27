"""The simulated person, operators that follow a script or a keyboard, and vests that tell nothing."""

from __future__ import annotations

import itertools
import math
import os
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from scipy import integrate, stats

from reference.plant import EXACT, Grasp, grasp, told_frame, with_
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError
from tega.haptics import vest_frame
from tega.runtime.keys import split_keys
from tega_sim.conditions import ShamName, sham_vest
from tega_sim.operator import (
    KeyboardOperator,
    Keys,
    Operator,
    ScriptedOperator,
    draw_person,
    load_parameters,
    typical_person,
)
from tega_sim.operator.belief import Closure, above, below
from tega_sim.operator.person import stream
from tega_sim.operator.scripted import Step
from tega_sim.operator.vision import Kind, SeenEvent
from tega_sim.seams import Percept, WorldTruth

STILL = WorldTruth(0.0, 0.0, False, (0.0,) * 4, 0.0, 0.0, 0.0, 0.0, False, 0.1)
FILE = Path(__file__).parents[2] / "python/tega_sim/operator/parameters.toml"


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
    rng, person = np.random.default_rng(4), typical_person()
    belief = Closure(person.grip, person.vest.threshold)
    for _ in range(4):
        for level in (2.0, 3.0, 4.0, 5.0):
            belief.set(level, 0.04)
            belief.feel("front", -0.8 + slope * (level - 3) + noise * float(rng.standard_normal()), 0.04)
    return belief


@pytest.mark.parametrize("slope", [0.8, -0.8])
def test_a_panel_that_follows_the_closure_is_trusted_and_moves_the_belief(slope: float) -> None:
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


MADE = vest_frame([80, 60, 40, 20], [10, 0, 100, 55], layout="x40")


def test_the_script_lifts_and_repeats_itself() -> None:
    operator = ScriptedOperator()
    first, second = grasp(operator, None), grasp(operator, None, trial=1)
    assert first.acts == second.acts
    assert first.highest_m > 0.2
    assert not first.dropped
    assert first.acts[-1].phase == "done"


def test_scripts_that_cannot_be_followed_are_refused() -> None:
    step = Step(0.0, "reach", 1, (0.0, 0.0), 1.0)
    for course in ((), (step._replace(t_s=1.0),), (step, step)):
        with pytest.raises(InvalidValueError, match="times rise from 0 s"):
            ScriptedOperator(course)
    with pytest.raises(InvalidValueError, match=r"level = 6 at 0\.0 s"):
        ScriptedOperator([step._replace(level=6)])


def test_keys_drive_level_and_lift() -> None:
    pressed = {10: ["3"], 20: ["right"] * 5, 300: ["up"] * 11, 700: ["down"] * 20, 1000: [" "], 1100: ["q"]}
    ticks = itertools.count()
    operator = KeyboardOperator(lambda: pressed.get(next(ticks), []))
    acts = [operator.act(Percept(tick / 100, STILL, None)) for tick in range(1101)]
    phases = list(dict.fromkeys(act.phase for act in acts))
    assert phases == ["reach", "grasp", "lift", "hold", "place", "release", "done"]
    assert acts[250].excitation == pytest.approx(0.7 * 0.625, rel=1e-3)
    assert acts[650].forearm_m == pytest.approx((0.22, 0.0))
    assert acts[-1].forearm_m == pytest.approx((0.0, 0.0))
    fastest = np.max(np.abs(np.diff([act.forearm_m for act in acts], axis=0)))
    assert fastest == pytest.approx(0.0015)


@pytest.mark.parametrize(
    ("sent", "keys", "rest"),
    [
        (b"12 q", ["1", "2", " ", "q"], b""),
        (b"\x1b[A\x1bOB\x1b[C\x1b[D", ["up", "down", "right", "left"], b""),
        (b"\x1b[5~3", ["3"], b""),  # page up is not level 5
        (b"\x1b[1;5A", ["up"], b""),
        (b"4\x1b", ["4"], b"\x1b"),
        (b"\x1b[", [], b"\x1b["),
        (b"\xc3\xa4\x7f2", ["\x7f", "2"], b""),
    ],
)
def test_what_a_terminal_sends_is_split_into_keys(sent: bytes, keys: list[str], rest: bytes) -> None:
    assert split_keys(sent) == (keys, rest)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_the_terminal_is_put_back_however_it_ends() -> None:
    import pty
    import termios

    master, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)

    def use() -> None:
        with Keys(terminal) as keys:
            assert termios.tcgetattr(terminal) != before
            assert keys.read() == []
            os.write(master, b"3\x1b[A")
            assert keys.read() == ["3", "up"]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        use()
    assert termios.tcgetattr(terminal) == before
    os.close(master)
    os.close(terminal)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_a_file_is_not_a_keyboard(tmp_path: Path) -> None:
    with (
        (tmp_path / "input").open("w+") as file,
        pytest.raises(DeviceUnavailableError, match="not a terminal; run"),
    ):
        Keys(file.fileno()).__enter__()


def test_each_sham_does_what_it_says() -> None:
    worn = {name: sham_vest(name, seed=3, recorded=[(0.0, MADE)])(1.0, MADE) for name in get_args(ShamName)}
    assert (worn["informative"], worn["off"]) == (MADE, None)
    levels = {name: frame.intensities for name, frame in worn.items() if frame is not None}
    assert not levels["silent"].any()
    assert set(levels["constant"].tolist()) == {50}
    rows, mixed = MADE.intensities.reshape(-1, 4), levels["permuted"].reshape(-1, 4)
    assert np.array_equal(np.sort(rows, axis=1), np.sort(mixed, axis=1))
    assert np.all(np.any(rows != mixed, axis=1))
    assert levels["inverted"][:4].tolist() == [20, 40, 60, 80]
    assert levels["inverted"][21] == 0


def test_the_unrelated_vest_covers_its_range_and_ignores_the_grip() -> None:
    first, second = sham_vest("unrelated", seed=1), sham_vest("unrelated", seed=1)
    still = vest_frame([0.0] * 4, [0.0] * 4, layout="x40")
    displayed = []
    for n in range(9_000):
        a, b = first(n / 30, MADE), second(n / 30, still)
        assert a == b is not None
        displayed.append(b.intensities[[0, 20]])
    front, back = np.array(displayed, float).T
    assert np.quantile(front, [0.1, 0.5, 0.9]) == pytest.approx([10, 50, 90], abs=8)
    assert abs(np.corrcoef(front, back)[0, 1]) < 0.2
    assert np.corrcoef(front[1:], front[:-1])[0, 1] > 0.9


def test_a_replayed_vest_keeps_the_times_of_its_trial() -> None:
    other = vest_frame([1] * 4, [2] * 4, layout="x40")
    vest = sham_vest("replayed", recorded=[(0.0, other), (1.0, MADE)])
    assert vest(0.5, MADE) is other
    assert vest(1.0, other) is MADE
    assert vest(99.0, other) is MADE
    with pytest.raises(InvalidValueError, match="recorded has no frame"):
        sham_vest("replayed")
    with pytest.raises(InvalidValueError, match="sham = 'placebo' is not known"):
        sham_vest("placebo")  # type: ignore[arg-type]
