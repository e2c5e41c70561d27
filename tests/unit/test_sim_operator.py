"""The simulated person: drawn from the file, sees and feels as late as measured, and gains nothing from shams."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy import integrate, stats

from reference.grasp_plant import Grasp, grasp
from tega.errors import ConfigError, InvalidValueError
from tega.haptics import VestFrame, vest_frame
from tega.sim.operator import Operator, Person, Rules, draw_person, load_parameters, sham_vest, typical_person
from tega.sim.operator.belief import Closure, ObjectBelief, above, below
from tega.sim.operator.motor import Motor
from tega.sim.operator.person import stream
from tega.sim.operator.vest_sense import Skin
from tega.sim.operator.vision import Eyes, reaction_s
from tega.sim.seams import Percept, Truth

STILL = Truth(0.0, 0.0, False, (0.0,) * 4, 0.0, 0.0, 0.0, 0.0, False, 0.1)
FILE = Path(__file__).parents[2] / "python/tega/sim/operator/parameters.toml"


def with_(who: Person, section: str, **values: float) -> Person:
    return msgspec.structs.replace(who, **{section: msgspec.structs.replace(getattr(who, section), **values)})


# --- parameters and population ---


def test_every_parameter_has_unit_mark_source_and_bounds_around_it() -> None:
    parameters = load_parameters()
    assert len(parameters.digest) == 64
    for _, name, p in parameters:
        assert p.low <= p.value <= p.high
        assert p.source
        assert p.unit or name in {"rt_correlation", "exponent", "adapt_gain", "attempts", "power"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("lapse = {", "relapse = {", "lapse"),
        (
            "rt_ms = { value = 215",
            "rt_ms = { value = 15",
            "vision.rt_ms = 15.0 ms is not within 160.0 to 320.0",
        ),
        ('mark = "A"', 'mark = "Z"', "Z"),
        ("[vision]", "[vision", "parameters"),
    ],
)
def test_a_parameter_file_that_is_not_right_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(FILE.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=said.replace(".", r"\.")):
        load_parameters(path)


def test_another_file_has_another_digest(tmp_path: Path) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(FILE.read_text() + "\n")
    assert load_parameters(path).digest != load_parameters().digest


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


# --- eyes ---


def test_reaction_times_are_skewed_about_the_mean_and_never_immediate() -> None:
    rng = stream(1, "test")
    drawn = np.array([reaction_s(rng, 215, 20, 45, 100) for _ in range(20_000)])
    assert drawn.mean() == pytest.approx(0.215, abs=0.002)
    assert drawn.std() == pytest.approx(math.hypot(0.020, 0.045), abs=0.002)
    assert stats.skew(drawn) > 1
    assert drawn.min() >= 0.1


def eyes(who: Person, seed: int = 0) -> Eyes:
    def process(name: str) -> np.random.Generator:
        return stream(seed, name)

    return Eyes(
        who.vision,
        width_m=0.07,
        gaze=process("gaze"),
        looks=process("looks"),
        poses=process("poses"),
        reaction=process("reaction"),
    )


@pytest.mark.parametrize(("speed_m_s", "seconds"), [(0.005, 0.446), (0.02, 0.301), (0.1, 0.238)])
def test_slip_is_seen_after_the_time_of_the_published_law(speed_m_s: float, seconds: float) -> None:
    """Times of Dzhafarov's law at 1.5 m with r = 205 ms, before the cost of a choice."""
    who = with_(
        typical_person(), "vision", gaze_grasp=1.0, rt_ms=205, rt_sigma_ms=0, rt_tau_ms=0.0, choice_ms=0
    )
    sight, scene = eyes(who), STILL._replace(slip_m_s=speed_m_s, lift_off=True)
    found = []
    for tick in range(1, 2000):
        found += sight.see(tick / 1000, 0.001, scene, carried=False, lifting=False)
    # The leak of the integral makes slow ones a little later.
    assert found[0].kind == "slip"
    assert seconds - 0.005 < found[0].due_s < seconds + 0.05


def test_nothing_is_seen_below_the_threshold_of_motion_or_while_looking_away() -> None:
    def slips(who: Person, speed_m_s: float) -> int:
        sight, scene = eyes(who), STILL._replace(slip_m_s=speed_m_s, lift_off=True)
        seen = [sight.see(t / 100, 0.01, scene, carried=False, lifting=False) for t in range(1, 1000)]
        return sum(event.kind == "slip" for events in seen for event in events)

    watching = with_(typical_person(), "vision", gaze_grasp=1.0)
    assert slips(watching, 0.0012) == 0
    assert slips(watching, 0.02) > 3
    assert slips(with_(watching, "vision", gaze_grasp=0.0), 0.5) == 0


@pytest.mark.parametrize(("share", "chance"), [(0.03, 0.003), (0.06, 0.5), (0.0770, 0.841), (0.12, 0.997)])
def test_deformation_is_seen_by_its_share_of_the_width(share: float, chance: float) -> None:
    sight = eyes(with_(typical_person(), "vision", gaze_grasp=1.0))
    scene = STILL._replace(deformation_m=0.07 * share)
    looks = [sight.see(t / 4, 0.25, scene, carried=False, lifting=False) for t in range(1, 3000)]
    seen = sum(event.kind == "deformation" for events in looks for event in events)
    assert seen / len(looks) == pytest.approx(chance, abs=0.03)


def test_contact_takes_two_fingers_and_an_object_left_behind_counts_as_slip() -> None:
    sight = eyes(with_(typical_person(), "vision", gaze_grasp=1.0))
    one = STILL._replace(pad_force_n=(1.0, 0.0, 0.0, 0.0))
    two = STILL._replace(pad_force_n=(1.0, 1.0, 0.0, 0.0))
    times = [t / 4 for t in range(1, 401)]
    assert not any(sight.see(t, 0.25, one, carried=False, lifting=False) for t in times)
    seen = [bool(sight.see(100 + t, 0.25, two, carried=False, lifting=False)) for t in times]
    assert np.mean(seen) == pytest.approx(0.5, abs=0.07)
    left = [STILL._replace(hand_to_object_m=0.1 * t / 100) for t in range(100)]
    for lifting, expected in ((False, 0), (True, 1)):
        sight = eyes(with_(typical_person(), "vision", gaze_grasp=1.0))
        kinds = [sight.see(1 + t / 100, 0.01, s, carried=True, lifting=lifting) for t, s in enumerate(left)]
        assert any(event.kind == "slip" for events in kinds for event in events) == expected


# --- vest ---


def skin(who: Person | None = None, seed: int = 0) -> Skin:
    who = who or typical_person()
    felt = Skin(who.vest, who.vision)
    felt.begin(rest_s=0, noise=stream(seed, "noise"), reaction=stream(seed, "rt"), link=stream(seed, "link"))
    return felt


def frame(level: int) -> VestFrame:
    """A frame whose motors are all on one of the sixteen levels."""
    percent = next(p for p in range(101) if (15 * p + 50) // 100 == level)
    return vest_frame([percent] * 4, [percent] * 4, layout="x40")


UNADAPTED = with_(typical_person(), "vest", adapt_gain=0.0)


@pytest.mark.parametrize(
    ("level", "chance"), [(1, 0.0), (2, 0.05), (3, 0.50), (4, 0.88), (5, 0.98), (15, 1.0)]
)
def test_levels_of_the_vest_are_felt_as_often_as_the_threshold_says(level: int, chance: float) -> None:
    felt, shown = skin(UNADAPTED), frame(level)
    for tick in range(100):
        felt.feel(tick / 100, 0.01, shown)
    looks = [felt.look(1 + n / 20, 0.05).front is not None for n in range(2000)]
    assert np.mean(looks) == pytest.approx(0.98 * chance, abs=0.03)


@pytest.mark.parametrize(
    ("lower", "higher", "right"), [(4, 5, 0.72), (8, 10, 0.72), (10, 12, 0.68), (8, 12, 0.85)]
)
def test_the_direction_of_a_change_is_felt_as_well_as_weber_says(
    lower: int, higher: int, right: float
) -> None:
    def readings(level: int, seed: int) -> list[float]:
        felt, shown = skin(with_(UNADAPTED, "vest", panel_swap=0), seed), frame(level)
        for tick in range(100):
            felt.feel(tick / 100, 0.01, shown)
        looks = [felt.look(1 + n / 20, 0.05).back for n in range(4000)]
        return [y for y in looks if y is not None]

    pairs = list(zip(readings(lower, 1), readings(higher, 2), strict=False))
    assert np.mean([a < b for a, b in pairs]) == pytest.approx(right, abs=0.03)


def test_motors_start_late_and_rise_in_the_time_of_an_eccentric_mass() -> None:
    felt, shown = skin(with_(UNADAPTED, "vest", link_sd_ms=0)), frame(15)
    course = []
    for tick in range(600):
        felt.feel(tick / 1000, 0.001, shown)
        course.append(float(felt._moving[0, 0]))
    assert course.index(next(a for a in course if a > 0)) == pytest.approx(45, abs=2)
    tenth, most = (next(n for n, a in enumerate(course) if a > share) for share in (0.1, 0.9))
    assert most - tenth == pytest.approx(132, abs=3)


def test_the_skin_adapts_over_minutes_and_recovers() -> None:
    felt, shown = skin(), frame(15)
    for tick in range(100):
        felt.feel(tick / 100, 0.01, shown)
    for n in range(15 * 60 * 20):
        felt.look(1 + n / 20, 0.05)
    assert felt._adapted == pytest.approx(np.full((2, 4), 1.6), abs=0.02)
    felt.begin(rest_s=900, noise=stream(0), reaction=stream(0), link=stream(0))
    assert felt._adapted == pytest.approx(np.ones((2, 4)), abs=0.02)


def share_weaker(before: int, after: float, seconds: float, windows: int) -> float:
    """Share of trials in which weakening was noticed within ``seconds`` of a fall of amplitude."""
    noticed = 0
    who = with_(UNADAPTED, "vest", panel_swap=0, lapse=0, threshold=0.01)
    for seed in range(windows):
        felt, t_s = skin(who, seed), 0.0
        felt._moving[:] = before / 15
        for n in range(10 + round(seconds * 20)):
            if n == 10:
                felt._moving[:] = before / 15 / after
            felt._moving[0] = 0.0  # the back alone
            t_s = n / 20
            felt.look(t_s, 0.05)
            noticed += felt.weaker(t_s, (True, True)) is not None
    return noticed / windows


@pytest.mark.parametrize(("fall", "chance"), [(2.0, 1.0), (1.5, 0.63), (1.3, 0.19), (1.0, 0.0)])
def test_weakening_is_noticed_as_often_as_the_rule_says(fall: float, chance: float) -> None:
    assert share_weaker(15, fall, 0.5, 300) == pytest.approx(chance, abs=0.08)


def test_a_constant_vest_gives_less_than_one_false_alarm_a_minute() -> None:
    felt, shown, alarms = skin(UNADAPTED), frame(8), 0
    for tick in range(30 * 60 * 20):
        felt.feel(tick / 20, 0.05, shown)
        felt.look(tick / 20, 0.05)
        alarms += tick > 40 and felt.weaker(tick / 20, (True, True)) is not None
    assert alarms / 30 < 1


# --- muscles ---


def motor(who: Person, level: int) -> Motor:
    arm = Motor(who.motor, full_effort=0.7, aim=stream(1, "aim"), sense=stream(1, "sense"))
    arm.command(level)
    return arm


EXACT = with_(typical_person(), "motor", aim_sd=0.0, aim_floor=0.0, effort_sd=0.0)


@pytest.mark.parametrize(("lag_ms", "rise_ms"), [(30, 101), (60, 202), (100, 335)])
def test_excitation_rises_as_a_comfortable_grip(lag_ms: float, rise_ms: float) -> None:
    arm = motor(with_(EXACT, "motor", lag_ms=lag_ms, slack_per_s=0.0), 4)
    course = [arm.step(n / 1000, 0.001) / 0.6125 for n in range(2000)]
    tenth, most = (next(n for n, u in enumerate(course) if u > share) for share in (0.1, 0.9))
    assert course[-1] == pytest.approx(1.0)
    assert most - tenth == pytest.approx(rise_ms, abs=2)


@pytest.mark.parametrize(("level", "seconds"), [(2, 13), (3, 7), (4, 5)])
def test_slack_walks_a_held_level_to_its_lower_edge(level: int, seconds: float) -> None:
    arm = motor(with_(EXACT, "motor", slack_floor=0.1), level)
    edge = 0.7 * (level - 1) / 4
    course = [arm.step(n / 100, 0.01) for n in range(3000)]
    assert next(n for n in range(100, 3000) if course[n] < edge) / 100 == pytest.approx(seconds, abs=0.8)
    arm.command(level)
    assert arm.step(30.01, 0.01) > course[-1]


def test_own_effort_is_felt_late_and_in_levels() -> None:
    arm = motor(with_(EXACT, "motor", slack_per_s=0.0), 3)
    felt, made = [], []
    for n in range(1000):
        made.append(4 * arm.step(n / 1000, 0.001) / 0.7 + 0.5)
        felt.append(arm.felt_level())
    assert felt[-1] == pytest.approx(3.0, abs=0.01)
    half = [next(n for n, level in enumerate(course) if level > 1.75) for course in (made, felt)]
    assert 55 <= half[1] - half[0] <= 75


# --- beliefs ---


@pytest.mark.parametrize(("x", "var"), [(2.0, 0.04), (3.5, 0.3), (5.0, 0.0)])
def test_learning_a_bound_gives_the_moments_of_the_cut_gaussian(x: float, var: float) -> None:
    def cut(need: float) -> float:
        return float(stats.norm.pdf(need, 3.0, 1.2)) * float(
            stats.norm.cdf((need - x) / max(math.sqrt(var), 1e-9))
        )

    moments = [
        integrate.quad(lambda n, k=k: n**k * cut(n), -6, 12, points=[x], limit=200)[0] for k in range(3)
    ]
    mean = moments[1] / moments[0]
    sd = math.sqrt(moments[2] / moments[0] - mean**2)
    assert above(3.0, 1.2, x, var, 0.0) == pytest.approx((mean, sd), abs=1e-5)
    mirrored = below(-3.0, 1.2, -x, var, 0.0)
    assert mirrored == pytest.approx((-mean, sd), abs=1e-5)


@pytest.mark.parametrize("slope", [0.8, -0.8])
def test_the_sign_of_the_vest_is_learned_and_then_used(slope: float) -> None:
    rng, closure = np.random.default_rng(4), Closure(typical_person().grip)
    assert not closure.known("front")
    for _ in range(6):
        for level in (1.5, 2.5, 3.5, 4.5):
            closure.set(level, 0.05)
            closure.feel("front", -1.0 + slope * level + 0.2 * float(rng.standard_normal()), 0.04)
    assert closure.known("front")
    assert not closure.known("back")
    assert closure.slope("front") == pytest.approx(slope, abs=0.15)
    closure.set(3.0, 0.3)
    closure.feel("front", -1.0 + slope * 4.0, 0.04)
    assert 3.4 < closure.x < 4.1
    assert closure.var < 0.2


def test_before_it_is_learned_the_vest_says_nothing_of_closure() -> None:
    closure = Closure(typical_person().grip)
    closure.set(3.0, 0.3)
    for y in (-2.0, 0.0, -1.0):
        closure.feel("front", y, 0.04)
    assert (closure.x, closure.var) == pytest.approx((3.0, 0.3))


def test_beliefs_fade_between_trials_and_are_carried_to_another_object() -> None:
    operator = Operator(typical_person(), seed=1)
    operator.begin("heavy", width_m=0.07)
    operator.beliefs["heavy"].need = (5.0, 0.3)
    operator.begin("heavy", width_m=0.07, trial=1)
    assert operator.beliefs["heavy"].need == pytest.approx((5.0, math.hypot(0.3, 0.2)))
    operator.begin("light", width_m=0.07)
    assert operator.beliefs["light"].need == pytest.approx((3.0 + 0.3 * 2.0, 1.2))
    assert isinstance(operator.beliefs["light"], ObjectBelief)


# --- the whole person ---


def test_a_trial_goes_through_its_phases_and_lifts() -> None:
    outcome = grasp(Operator(EXACT, seed=2), None)
    phases = list(dict.fromkeys(act.phase for act in outcome.acts))
    assert phases == ["reach", "grasp", "lift", "hold", "place", "release", "done"]
    assert outcome.highest_m > 0.2
    assert not outcome.dropped
    assert outcome.acts[0].forearm_m == pytest.approx((0.0, 0.1))
    assert max(act.excitation for act in outcome.acts) <= 1.15


def test_the_same_seed_does_the_same_and_another_does_not() -> None:
    def acts(seed: int) -> object:
        return grasp(Operator(draw_person(3), seed=seed), sham_vest("informative")).acts

    assert acts(1) == acts(1)
    assert acts(1) != acts(2)


def test_who_cannot_feel_the_vest_acts_as_if_there_were_none() -> None:
    for name in ("informative", "unrelated"):
        deaf = grasp(Operator(draw_person(4), seed=5, feels=False), sham_vest("informative", seed=1))
        without = grasp(Operator(draw_person(4), seed=5), None)
        silent = grasp(Operator(draw_person(4), seed=5), sham_vest("silent"))
        assert deaf.acts == without.acts == silent.acts, name


def test_which_finger_vibrates_changes_nothing() -> None:
    real = grasp(Operator(draw_person(4), seed=5), sham_vest("informative"))
    assert grasp(Operator(draw_person(4), seed=5), sham_vest("permuted", seed=2)).acts == real.acts


def test_rules_switched_off_leave_a_vest_without_effect() -> None:
    rules = Rules(onset=False, weaker=False, reading=False)
    without = grasp(Operator(draw_person(4), seed=5), None)
    assert grasp(Operator(draw_person(4), seed=5, rules=rules), sham_vest("informative")).acts == without.acts


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
        operator = Operator(watching, seed=1)
        outcomes = [grasp(operator, None, item=item, trial=trial) for trial in range(4)]
        acts = [act for outcome in outcomes for act in outcome.acts]
        held[name] = np.mean([act.excitation for act in acts if act.phase == "hold"])
        beliefs[name] = operator.beliefs["object"]
        assert [outcome.deformed for outcome in outcomes] == [name == "fragile", False, False, False]
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
    before: Callable[[], float] = stream(7, "gaze").random
    first.random(10)
    assert second.random() == before()
