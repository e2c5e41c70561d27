"""How well events are found in the signals of the simulated bench: fits the slip's rules, and compares with the truth.

::

    python -m tega_figures.check_events --fit 1000:1023                       # weights for tega.stages.events.settings
    python -m tega_figures.check_events --fit 1000:1023 --shear texture --truth   # what the gels' true shear would tell
    python -m tega_figures.check_events --seeds 2000:2020 --conditions haptic # the table of docs/detect.md
    python -m tega_figures.check_events --narrowing --objects bag             # what a deformation could be told by
    python -m tega_figures.check_events --conditions haptic --shear texture   # of docs/evidence/sim-touch.md

Needs the extras ``sim`` and ``study``. A seed is a person; those that the rules were fitted on are never reported.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from tega.hand.tips import tip_heights_mm
from tega.stages.events import Detector, ShearFrame
from tega.stages.events.settings import SETTINGS
from tega_figures.pad_slides import (
    INCIPIENT,
    INCIPIENT_FOR_S,
    READ_FOR_S,
    READ_MM_S,
    TRUE_MM_S,
    PadStep,
    pad_step,
    slides_told,
    told_by,
    told_by_truth,
)
from tega_figures.slip_rule import (
    N_PRODUCTS,
    SINK_ENTER,
    SINK_LEAST_S,
    TOLERANCE_S,
    fit,
    left_out,
    looks_of,
    told_of,
)
from tega_figures.slip_score import (
    HEAD,
    ScoredTrial,
    SlipsTold,
    by_speed,
    read_scored,
    score_row,
    slid_mm,
    true_shear,
)
from tega_sim.gel import PX_PER_MM
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.streams import Streams
from tega_study.detecting import events_of
from tega_study.hand_rows import HandRow
from tega_study.score import Agreement, agreement
from tega_study.touch_rows import TouchRow

if TYPE_CHECKING:
    from tega.records import Contact, Intent
    from tega_sim.gel import Gel, ShearTruth
    from tega_sim.seams import Act, Percept

__all__ = ["JudgedTrial", "KeptTrial", "compare", "judge", "main", "run"]

KINDS = ("lift_off", "slip")
WAYS = ("record", "live", "live, touch only", "live, without joints")
_SPEEDS_MM_S = (5, 6, 8)
_SHEAR = ("stages.metric.name=shear", f"stages.metric.options.mm_per_px={1 / PX_PER_MM:.6g}")
_PLACING = frozenset({"place", "release", "done"})
_HOLDS_LEVEL = 1.5


class KeptTrial(NamedTuple):
    """A trial as the sensors saw it, and its truth.

    Attributes:
        result: What became of it.
        touch: Every frame of the fingertips.
        hand: Hand and arm a hundred times a second.
        slipping: Beginning and end of each slip, seconds.
        narrowing: How much narrower the object is, by time: seconds, millimetres.
        shear: Time, finger and shear of every frame; empty where the gels have none.
        speed: How fast the object slides, by time: seconds, metres a second.
        gels: Time, finger and true shear of its gel at every frame; nothing slides in gels without.
        pads: Where the object truly lies on the fingertips, every frame of each.
    """

    result: TrialResult
    touch: list[TouchRow]
    hand: list[HandRow]
    slipping: list[tuple[float, float]]
    narrowing: Sequence[tuple[float, float]] = ()
    shear: Sequence[tuple[float, str, ShearFrame]] = ()
    speed: Sequence[tuple[float, float]] = ()
    gels: Sequence[tuple[float, str, ShearTruth]] = ()
    pads: Sequence[PadStep] = ()


class _Keeper(Streams):
    def __init__(self, gels: Mapping[str, Gel]) -> None:
        super().__init__()
        self._gels = gels
        self.touch: list[TouchRow] = []
        self.hand: list[HandRow] = []
        self.speed: list[tuple[float, float]] = []
        self.narrowing: list[tuple[float, float]] = []
        self.shear: list[tuple[float, str, ShearFrame]] = []
        self.true_shear: list[tuple[float, str, ShearTruth]] = []
        self.pads: list[PadStep] = []
        self._level: int | None = None

    def act(self, percept: Percept, act: Act) -> None:
        tips_mm = None if percept.angles_rad is None else tip_heights_mm(percept.angles_rad)
        self.hand.append(HandRow(percept.t_s, self._level, percept.closure, act.forearm_m[0], tips_mm))
        self.speed.append((percept.t_s, percept.scene.slip_m_s))
        self.narrowing.append((percept.t_s, 1e3 * percept.scene.deformation_m))

    def contact(self, contact: Contact) -> None:
        gel = self._gels[contact.finger]
        t_s, shapes = gel.pressed
        self.pads.append(pad_step(t_s, contact.finger, shapes, gel.in_view if shapes else math.nan))
        if (shear := ShearFrame.of({value.name: value.value for value in contact.more})) is not None:
            self.shear.append((contact.t_ns / 1e9, contact.finger, shear))
            self.true_shear.append((contact.t_ns / 1e9, contact.finger, gel.sheared))
        self.touch.append(
            TouchRow(
                contact.t_ns / 1e9,
                contact.finger,
                int(contact.in_contact),
                contact.eda,
                contact.mass,
                contact.peak,
                *contact.centroid_xy,
            )
        )

    def levels(self, intent: Intent) -> None:
        self._level = intent.level


def run(plan: TrialPlan) -> KeptTrial:
    """Run a trial and keep what its sensors say."""
    from tega_sim.lab import lab_of
    from tega_sim.score import REST_M_S
    from tega_sim.trial import run_trial

    keeper = _Keeper(lab_of(plan.seed, plan.preset, plan.settings, plan.shear).gels)
    result = run_trial(plan, streams=keeper)
    slipping = []
    for event in result.events:
        if event.kind == "slip":
            rests = (t for t, v in keeper.speed if t > event.t_s + 0.3 and v < REST_M_S)
            slipping.append((event.t_s, next(rests, result.duration_s)))
    return KeptTrial(
        result,
        keeper.touch,
        keeper.hand,
        slipping,
        keeper.narrowing,
        keeper.shear,
        keeper.speed,
        keeper.true_shear,
        keeper.pads,
    )


class JudgedTrial(NamedTuple):
    """A trial's truth and what was found in it.

    Attributes:
        result: What became of it.
        found: Times by way and kind, seconds; live, an event is there when it is told.
        speed: How fast the object slides, by time: seconds, metres a second.
    """

    result: TrialResult
    found: dict[tuple[str, str], list[float]]
    speed: Sequence[tuple[float, float]] = ()


def judge(kept: KeptTrial) -> JudgedTrial:
    """Find a trial's events in each of :data:`WAYS`."""
    times: dict[tuple[str, str], list[float]] = {}
    for way in WAYS:
        hand = [] if way == WAYS[2] else kept.hand
        if way == WAYS[3]:
            hand = [row._replace(tips_mm=None) for row in hand]
        ahead_s = SETTINGS.look_ahead_s if way == WAYS[0] else 0.0
        found = events_of(kept.touch, hand, detector=Detector(look_ahead_s=ahead_s), shear=kept.shear)
        for kind in KINDS:
            times[way, kind] = [
                event.t_s if way == WAYS[0] else event.known_s for event in found if event.kind == kind
            ]
    return JudgedTrial(kept.result, times, kept.speed)


def compare(trials: Sequence[JudgedTrial], way: str, kind: str) -> Agreement:
    """Compare the truth of trials with what is found."""
    truth = [[e.t_s for e in one.result.events if e.kind == kind] for one in trials]
    found = [one.found[way, kind] for one in trials]
    lengths_s = [one.result.duration_s for one in trials]
    return agreement(kind, ("truth", "detector"), truth, found, lengths_s, tolerance_s=TOLERANCE_S)


def _judged(plan: TrialPlan) -> JudgedTrial:
    return judge(run(plan))


def narrowing(trials: Sequence[KeptTrial]) -> Iterable[str]:
    """Say how well the signals tell how much narrower a held object is: least squares, ten looks a second."""
    looks, true_mm = [], []
    for one in trials:
        lifted_s = next((e.t_s for e in one.result.events if e.kind == "lift_off"), math.inf)
        first_s = next((row.t_s for row in one.touch if row.in_contact), math.inf)
        held = max(first_s, lifted_s) < math.inf
        t_s = np.arange(lifted_s, one.result.duration_s, 0.1) if held else np.zeros(0)
        closure = np.array([(row.t_s, row.closure) for row in one.hand if row.closure is not None])
        closed = np.interp(t_s, *closure.T)
        touch = np.zeros((2, len(t_s)))
        for finger in {row.finger for row in one.touch}:
            mine = np.array(
                [
                    (r.t_s, *((r.mass, r.eda) if r.in_contact else (0.0, 0)))
                    for r in one.touch
                    if r.finger == finger
                ]
            )
            touch += [np.interp(t_s, mine[:, 0], mine[:, n]) for n in (1, 2)]
        gained = closed - np.interp(first_s, *closure.T)
        holds = closed > _HOLDS_LEVEL
        looks.append(np.stack([np.ones(len(t_s)), gained, *touch], axis=1)[holds])
        true_mm.append(np.interp(t_s, *np.array(one.narrowing).T)[holds])
    x, y = np.concatenate(looks), np.concatenate(true_mm)
    yield "| narrowing of a held object, told by | standard deviation of what is left, mm | 95 % within, mm |"
    yield "|---|---|---|"
    for what, columns in (
        ("nothing", [0]),
        ("areas and sums of the fingertips", [0, 2, 3]),
        ("closure gained since contact", [0, 1]),
        ("both", [0, 1, 2, 3]),
    ):
        left = y - x[:, columns] @ np.linalg.lstsq(x[:, columns], y, rcond=None)[0]
        yield f"| {what} | {left.std():.2f} | {np.quantile(np.abs(left), 0.95):.2f} |"


def _plans(
    seeds: Iterable[int],
    conditions: Sequence[str],
    stiffness: float,
    friction: float,
    shear: str = "off",
    *,
    relief: float = 0.0,
) -> list[TrialPlan]:
    from tega_sim.world import OBJECTS

    return [
        TrialPlan.checked(
            {
                "object": name,
                "condition": condition,
                "seed": seed,
                "stiffness_n_m": OBJECTS[name].stiffness_n_m * stiffness,
                "friction": OBJECTS[name].friction * friction,
                "shear": shear,
                "spec": OBJECTS[name].with_(relief_counts=relief) if relief else None,
                "settings": () if shear == "off" else _SHEAR,
            }
        )
        for seed in seeds
        for name in OBJECTS
        for condition in conditions
    ]


def _table(trials: Sequence[JudgedTrial]) -> Iterable[str]:
    yield (
        "| event | seen | object | vest | trials | true | found | both "
        "| precision | recall | F1 | chance | delay, s | kappa |"
    )
    yield "|" + "---|" * 14
    objects = list(dict.fromkeys(one.result.object for one in trials))
    vests = list(dict.fromkeys(one.result.condition for one in trials))
    groups = [("all", "all"), *((o, "all") for o in objects if len(objects) > 1)]
    groups += [("all", v) for v in vests if len(vests) > 1]
    for kind in KINDS:
        for way in WAYS:
            if kind != "slip" and way in WAYS[2:]:
                continue  # needs hand and arm, and no joints
            for name, vest in groups:
                some = [
                    t
                    for t in trials
                    if name in {"all", t.result.object} and vest in {"all", t.result.condition}
                ]
                one = compare(some, way, kind)
                if not one.n_a and not one.n_b:
                    continue
                cells = (
                    one.matched / one.n_b if one.n_b else None,
                    one.matched / one.n_a if one.n_a else None,
                )
                numbers = " | ".join(
                    _number(v) for v in (*cells, one.f1, one.chance_f1, one.delay_s, one.kappa)
                )
                yield (
                    f"| {kind.replace('_', '-')} | {way} | {name} | {vest} | {one.trials} | {one.n_a} | {one.n_b} | "
                    f"{one.matched} | {numbers} |"
                )


def told(trials: Sequence[JudgedTrial], way: str) -> list[SlipsTold]:
    """Return the true slips of trials and those that were found in a way."""
    return [
        SlipsTold(
            one.result.seed,
            one.result.duration_s / 60,
            [e.t_s for e in one.result.events if e.kind == "slip"],
            one.found[way, "slip"],
            [slid_mm(one.speed, t_s) for t_s in one.found[way, "slip"]],
        )
        for one in trials
    ]


def _fitted(kept: Sequence[KeptTrial], *, products: int, truth: bool) -> Iterable[str]:
    """Fit the slip's rules on trials, and say how they do with a fifth of the people left out in turn."""
    shown = [true_shear(one) for one in kept] if truth else kept
    rows = [HEAD]
    for name in ("touch",) if truth else ("touch", "hand", "sink"):
        hand, sink = name != "touch", name == "sink"
        seen = [looks_of(one, hand=hand, sink=sink) for one in shown]
        products = 0 if sink else products
        best, found_left_out = left_out(seen, products=products)
        rule = fit(
            seen,
            products=products,
            at=best._replace(enter=SINK_ENTER, least_s=SINK_LEAST_S) if sink else None,
        )
        yield f"{name}: {rule}"
        ways = {f"{name}, left out": found_left_out}
        ways[f"{name}, **in-sample**"] = [told_of(rule, one) for one in seen]
        if not hand:
            for mm_s in _SPEEDS_MM_S:
                ways[f"true speed, {mm_s} mm/s"] = [by_speed(one, mm_s / 1e3) for one in kept]
        for what, found in ways.items():
            judged = [
                JudgedTrial(one.result, {(what, "slip"): f}) for one, f in zip(kept, found, strict=True)
            ]
            rows.append(score_row(what, told(judged, what)))
    yield from rows


def _over_pads(trial: KeptTrial, found: Mapping[tuple[str, str], list[float]]) -> dict[str, SlipsTold]:
    """Return what each way told beside the slides over the fingertips: all of them, and those in the picture."""
    by = {
        f"{way}, against the palm": times
        for (way, kind), times in found.items()
        if kind == "slip" and way in WAYS[1:3]
    }
    by[f"slide read, {READ_MM_S:g} mm/s"] = told_by(
        trial.shear, lambda one: math.hypot(one.slide_x_mm_s, one.slide_y_mm_s), READ_MM_S, READ_FOR_S
    )
    by[f"incipient, {INCIPIENT:g}"] = told_by(
        trial.shear, lambda one: one.incipient, INCIPIENT, INCIPIENT_FOR_S
    )
    by[f"true slide, {TRUE_MM_S:g} mm/s"] = told_by_truth(trial.pads)
    who = trial.result.seed, trial.result.duration_s / 60, trial.pads
    return {
        f"over the pads; {way}{', in the picture' if seen else ''}": slides_told(*who, times, seen=seen)
        for way, times in by.items()
        for seen in (False, True)
    }


def _keep(file: Path, plans: Iterable[TrialPlan]) -> None:
    """Add to a file the slips that are told in trials which it does not hold yet, by both truths.

    Args:
        file: The file.
        plans: The trials.
    """
    kept = read_scored(file) if file.exists() else []
    known = {(one.ways[WAYS[0]].person, one.object, one.shear) for one in kept}
    with file.open("ab") as out:
        for plan in plans:
            if (plan.seed, plan.object, plan.shear) not in known:
                trial = run(plan)
                found = judge(trial).found
                for mm_s in _SPEEDS_MM_S:
                    found[f"true speed, {mm_s} mm/s", "slip"] = by_speed(trial, mm_s / 1e3)
                judged = JudgedTrial(trial.result, found, trial.speed)
                ways = {way: told([judged], way)[0] for way, kind in found if kind == "slip"}
                ways |= _over_pads(trial, found)
                out.write(msgspec.json.encode(ScoredTrial(plan.object, plan.shear, ways)) + b"\n")
                out.flush()


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _seeds(text: str) -> list[int]:
    parts = (part.partition(":") for part in text.split(","))
    return [seed for first, _, end in parts for seed in range(int(first), int(end))]


def main() -> None:
    """Fit, or print the table."""
    parser = argparse.ArgumentParser(
        description="Events found in the signals against the truth; all simulated."
    )
    parser.add_argument("--fit", type=_seeds, metavar="A:B,...", help="fit the slip's rules on these people")
    parser.add_argument("--seeds", type=_seeds, default=range(2000, 2010), metavar="A:B")
    parser.add_argument("--conditions", default="haptic,non-haptic,event-gated")
    parser.add_argument("--stiffness", type=float, default=1.0, help="of the objects, times their own")
    parser.add_argument("--friction", type=float, default=1.0, help="likewise")
    parser.add_argument(
        "--shear",
        default="off",
        choices=["off", "texture", "dots"],
        help="of the gels; the metric is shear then",
    )
    parser.add_argument(
        "--relief",
        type=float,
        default=0.0,
        metavar="COUNTS",
        help="contrast of the objects' relief; 0 is smooth",
    )
    parser.add_argument("--objects", default="", help="some of them, by name; all unless given")
    parser.add_argument(
        "--narrowing", action="store_true", help="how well the signals tell an object's narrowing"
    )
    parser.add_argument(
        "--products",
        type=int,
        default=N_PRODUCTS,
        help="of two features, that a fitted rule looks at besides",
    )
    parser.add_argument(
        "--truth", action="store_true", help="fit on the gels' true shear in the place of the reading's"
    )
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="FILE",
        help="add the trials to FILE one by one; goes on where it was stopped",
    )
    parser.add_argument("--jobs", type=int, default=-1)
    asked = parser.parse_args()
    from joblib import Parallel, delayed

    if asked.fit is not None:
        plans = _plans(
            asked.fit, ["haptic"], asked.stiffness, asked.friction, asked.shear, relief=asked.relief
        )
        kept: list[KeptTrial] = Parallel(n_jobs=asked.jobs)(delayed(run)(plan) for plan in plans)
        for line in _fitted(kept, products=asked.products, truth=asked.truth):
            sys.stdout.write(line + "\n")
        return
    conditions = asked.conditions.split(",")
    plans = _plans(asked.seeds, conditions, asked.stiffness, asked.friction, asked.shear, relief=asked.relief)
    plans = [plan for plan in plans if not asked.objects or plan.object in asked.objects.split(",")]
    if asked.narrowing:
        trials: list[KeptTrial] = Parallel(n_jobs=asked.jobs)(delayed(run)(plan) for plan in plans)
        sys.stdout.writelines(line + "\n" for line in narrowing(trials))
        return
    if asked.keep is not None:
        _keep(asked.keep, plans)
        return
    judged: list[JudgedTrial] = Parallel(n_jobs=asked.jobs)(delayed(_judged)(plan) for plan in plans)
    for line in _table(judged):
        sys.stdout.write(line + "\n")
    for line in (HEAD, *(score_row(way, told(judged, way)) for way in WAYS)):
        sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main()
