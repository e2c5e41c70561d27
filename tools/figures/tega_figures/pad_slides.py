"""Says when objects truly slide over fingertips, and when what is read of the fingertips' pictures tells it.

The second truth of ``docs/evidence/sim-touch.md``: a slip as the literature has it, of the object over a fingertip,
whatever the object does against the palm. :func:`slides_of` has its definition.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega_figures.slip_score import SlipsTold

if TYPE_CHECKING:
    from tega.stages.events import ShearFrame
    from tega_sim.seams import Indenter

__all__ = ["PadStep", "Slide", "merged", "pad_step", "slides_of", "slides_told", "told_by", "told_by_truth"]

BEARS_N: Final = 0.5
"""Normal force from which an object bears on a fingertip: the least with which every shape is seen in a picture."""

WAY_MM, WITHIN_S = 1.0, 0.2
"""A slide: so far in so long, so with 5 mm/s in the mean, the speed of the first truth's slips."""

ONSET_MM: Final = 0.1
"""It begins where it has come so far: two pixels of a fingertip's picture."""

OVER_MM: Final = 0.1
"""It is over when it has come less far in :data:`WITHIN_S`."""

APART_S: Final = 0.5
"""Slides of fingers that begin within so long of the end of another are one: the first truth's rest."""

IN_VIEW: Final = 0.5
"""Share of a contact's area from which it is in the picture."""

READ_MM_S, READ_FOR_S = 5.0, 0.0
"""A slide that is read so fast for so long is told."""

INCIPIENT, INCIPIENT_FOR_S = 0.7, 0.03
"""A share of the contact that has slid is told from here, after so long."""

TRUE_MM_S, TRUE_FOR_S = 6.0, 0.03
"""A true slide over a pad so fast for so long is told, for comparison."""


class PadStep(NamedTuple):
    """Where an object lies on a fingertip in one frame, by the physics.

    Attributes:
        t_s: When, seconds.
        finger: Whose fingertip.
        force_n: Normal force on it, newtons; 0 where nothing touches.
        around_mm: Where the pad's middle is on the object's surface, around its axis, with what only rolls left out.
        along_mm: And along its axis.
        in_view: Share of the touching area that is in the picture, 0 to 1; NaN without.
    """

    t_s: float
    finger: str
    force_n: float = 0.0
    around_mm: float = 0.0
    along_mm: float = 0.0
    in_view: float = math.nan


class Slide(NamedTuple):
    """A slide over a fingertip, or over several that go on together.

    Attributes:
        begin_s: When it had come :data:`ONSET_MM` far, seconds.
        end_s: When it was over.
        seen: Whether the contact of the finger that begins is in the picture.
    """

    begin_s: float
    end_s: float
    seen: bool


def pad_step(t_s: float, finger: str, shapes: Sequence[Indenter], in_view: float) -> PadStep:
    """Return where a round object lies on a fingertip, in the coordinates that its relief has in a gel's picture.

    Args:
        t_s: When, seconds.
        finger: Whose fingertip.
        shapes: What presses it; the one that presses most is looked at.
        in_view: Share of the touching area that is in the picture.
    """
    if not shapes:
        return PadStep(t_s, finger)
    one = max(shapes, key=lambda shape: shape.force_n)
    pose, radius_mm = one.pose_mm, one.size_mm[0]
    along = pose[:2, 2] / np.hypot(*pose[:2, 2])
    across, below = np.array([-along[1], along[0]]), -pose[2, :2]
    aside = pose[:2, :2].T @ across
    if below[0] * aside[1] - below[1] * aside[0] < 0:
        across = -across
    turned = math.atan2(-below[0], below[1])
    middle = -pose[:2, 3]
    around_mm = radius_mm * (turned + math.asin(min(max(float(middle @ across) / radius_mm, -1.0), 1.0)))
    return PadStep(
        t_s, finger, sum(shape.force_n for shape in shapes), around_mm, float(middle @ along), in_view
    )


def slides_of(steps: Sequence[PadStep]) -> list[Slide]:
    """Return the slides over one fingertip.

    While the object bears on it with :data:`BEARS_N` or more, one is there as soon as it lies :data:`WAY_MM` from
    where it lay within the last :data:`WITHIN_S`. It began when it was last within :data:`ONSET_MM` of that place, and
    is over when it has come less than :data:`OVER_MM` in :data:`WITHIN_S`, or bears no more.

    Args:
        steps: Of that fingertip, in the order of time.
    """
    found: list[Slide] = []
    open_: Slide | None = None
    lately: list[PadStep] = []
    for step in steps:
        if step.force_n < BEARS_N:
            if open_ is not None:
                found.append(open_._replace(end_s=step.t_s))
            open_, lately = None, []
            continue
        lately = [one for one in lately if one.t_s > step.t_s - WITHIN_S - 1e-3] + [step]
        if open_ is None:
            first = max(range(len(lately)), key=lambda n: _apart_mm(lately[n], step))
            if _apart_mm(lately[first], step) >= WAY_MM:
                ways = [_apart_mm(one, lately[first]) for one in lately]
                last = max(n for n, way in enumerate(ways) if n >= first and way < ONSET_MM)
                share = (ONSET_MM - ways[last]) / (ways[last + 1] - ways[last])
                begin_s = lately[last].t_s + share * (lately[last + 1].t_s - lately[last].t_s)
                open_ = Slide(begin_s, math.inf, lately[last].in_view >= IN_VIEW)
        elif step.t_s - lately[0].t_s >= WITHIN_S - 1e-3 and _apart_mm(lately[0], step) < OVER_MM:
            found.append(open_._replace(end_s=lately[0].t_s))
            open_, lately = None, [step]
    if open_ is not None:
        found.append(open_._replace(end_s=steps[-1].t_s))
    return found


def merged(steps: Sequence[PadStep]) -> list[Slide]:
    """Return the slides over a hand's fingertips; those that begin within :data:`APART_S` of another's end are one."""
    fingers = dict.fromkeys(step.finger for step in steps)
    every = [one for finger in fingers for one in slides_of([s for s in steps if s.finger == finger])]
    found: list[Slide] = []
    for one in sorted(every):
        if found and one.begin_s < found[-1].end_s + APART_S:
            found[-1] = found[-1]._replace(end_s=max(found[-1].end_s, one.end_s))
        else:
            found.append(one)
    return found


def told_by(
    shear: Sequence[tuple[float, str, ShearFrame]],
    value: Callable[[ShearFrame], float],
    least: float,
    least_s: float,
) -> list[float]:
    """Return when a value of a fingertip's frames, the highest of all fingers, has been high for so long, seconds.

    As the detector's, it is told once until it has been low for half a second.

    Args:
        shear: Time, finger and shear of every frame.
        value: What of it is looked at.
        least: From where it is high.
        least_s: For how long it has to be.
    """
    return _risen([(t_s, finger, value(frame)) for t_s, finger, frame in shear], least, least_s)


def told_by_truth(steps: Sequence[PadStep]) -> list[float]:
    """Return when true slides over two frames are told, seconds; without a camera's delay."""
    before: dict[str, list[PadStep]] = {}
    speeds: list[tuple[float, str, float]] = []
    for step in steps:
        lately = before.setdefault(step.finger, [])
        lately[:] = [*lately, step][-3:]
        bears = len(lately) == 3 and all(one.force_n >= BEARS_N for one in lately)
        way_mm = _apart_mm(lately[0], step) if bears else 0.0
        speeds.append((step.t_s, step.finger, way_mm / max(step.t_s - lately[0].t_s, 1e-3)))
    return _risen(speeds, TRUE_MM_S, TRUE_FOR_S)


def _risen(values: Iterable[tuple[float, str, float]], least: float, least_s: float) -> list[float]:
    newest: dict[str, float] = {}
    told: list[float] = []
    since_s, free_s = math.inf, -math.inf
    for t_s, finger, value in values:
        newest[finger] = value
        if max(newest.values()) < least:
            since_s = math.inf
            continue
        since_s = min(since_s, t_s)
        if t_s - since_s >= least_s - 1e-3:
            if t_s >= free_s:
                told.append(t_s)
            free_s = t_s + APART_S
    return told


def slides_told(
    person: int, minutes: float, steps: Sequence[PadStep], told_s: Sequence[float], *, seen: bool
) -> SlipsTold:
    """Return what was told beside the true slides of a trial.

    Args:
        person: Whose.
        minutes: Length of the trial.
        steps: Of all fingertips.
        told_s: When slides were told.
        seen: Whether only those in the picture are asked for; what is told of others is neither right nor false then.
    """
    from tega_figures.slip_rule import TOLERANCE_S
    from tega_study.score import match_events

    true = merged(steps)
    begins = [one.begin_s for one in true]
    told = list(told_s)
    if seen:
        pairs = match_events(begins, told, tolerance_s=TOLERANCE_S)
        others = {j for i, j in pairs if not true[i].seen}
        told = [t_s for j, t_s in enumerate(told) if j not in others]
        begins = [one.begin_s for one in true if one.seen]
    return SlipsTold(person, minutes, begins, told, [_way_mm(steps, t_s, TOLERANCE_S) for t_s in told])


def _apart_mm(one: PadStep, two: PadStep) -> float:
    return math.hypot(one.around_mm - two.around_mm, one.along_mm - two.along_mm)


def _way_mm(steps: Iterable[PadStep], t_s: float, within_s: float) -> float:
    """Return the farthest that an object lay from where it lay on a fingertip at a time, within some time of it."""
    near = [one for one in steps if abs(one.t_s - t_s) <= within_s and one.force_n > 0]
    farthest = 0.0
    for finger in dict.fromkeys(one.finger for one in near):
        mine = [one for one in near if one.finger == finger]
        here = min(mine, key=lambda one: abs(one.t_s - t_s))
        farthest = max(farthest, *(_apart_mm(one, here) for one in mine))
    return farthest
