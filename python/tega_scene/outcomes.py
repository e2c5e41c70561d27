"""Score a lift from the poses that a camera saw: lift-off, 0.2 m, stable, slips, deformations, drop, put down, placed.

The rule is that of a simulated trial's truth (:class:`tega_sim.score.TrialScorer`), here with measured input
(:mod:`tega_scene.courses`).
"""

from __future__ import annotations

from typing import Final, Literal

import msgspec
import numpy as np

from tega.stages.events.outcomes import LIFT_WINDOW_S, STABLE_S
from tega_scene.courses import (
    GRID_S,
    LOST_M,
    REST_S,
    SceneCourses,
    SceneRest,
    checked_mark,
    placed,
    resting,
    righted,
    scene_courses,
)
from tega_scene.layout import TagLayout
from tega_scene.track import SceneTrack
from tega_sim.score import TrialScorer
from tega_sim.seams import WorldTruth

OFF_M, STANDS_M = 1e-3, 0.5e-3
"""Height of the object's lowest point from which it is off the table, and below which it stands again."""

_GAP_S: Final = 0.25
_SUSTAINED_S: Final = 0.05
_TAKEN_S: Final = 0.07
"""How long after its lift-off an object gives in the hand before that counts as a slip."""

OutcomeKind = Literal["lift_off", "lifted", "slip", "deformation", "drop", "put_down", "placed"]


class SceneEvent(msgspec.Struct, frozen=True):
    """One outcome, as measured.

    Attributes:
        kind: ``lifted`` is stable at 0.2 m, ``put_down`` stands on the table again, ``placed`` stands on the
            second mark, upright and still for a second, and let go of.
        t_s: When, on the video's clock; ``lifted`` and ``placed``: when it was complete.
        t_error_s: Standard error of that.
        size_m: Slip: way slid. Deformation: largest narrowing. Put down and placed: distance from the mark in
            the end, from the first one where no second is given. Else 0.
        size_error_m: Standard error of that.
    """

    kind: OutcomeKind
    t_s: float
    t_error_s: float = 0.0
    size_m: float = 0.0
    size_error_m: float = 0.0


class SceneOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of a trial as a camera measured it; each error is a standard error.

    Attributes:
        events: In the order of time.
        success: Whether it was lifted to 0.2 m, was stable there for a second, within the window, and not
            dropped; with a second mark, whether it was placed there as well.
        slid_m: Way slid in all.
        narrowing_m: Largest narrowing; ``None``, and its error, where its tags were not seen.
        along_mm: Standard error of the object's place along the view, one picture of those that place it.
        across_mm: Standard error of the object's place across the view, in the same way.
        seen: Share of the pictures in which the object was seen.
        placed: Share of the pictures that place it (:data:`~tega_scene.courses.PLACED_M`).
        hand_seen: Share in which the hand was.
        longest_gap_s: Longest time without the object, between two sights of it.
        notes: What to look at before these numbers are believed.
        rest: Where it stands at the end; ``None`` where it was not put down, or not seen then.
        off_mark_m: How far from the second mark that is; ``None`` without a mark.
        on_mark: Whether it was placed on the second mark; ``None`` without a mark.
    """

    events: tuple[SceneEvent, ...]
    success: bool
    slid_m: float
    slid_error_m: float
    narrowing_m: float | None
    narrowing_error_m: float | None
    height_m: float
    along_mm: float
    across_mm: float
    seen: float
    placed: float
    hand_seen: float
    longest_gap_s: float
    notes: tuple[str, ...]
    rest: SceneRest | None = None
    off_mark_m: float | None = None
    off_mark_error_m: float | None = None
    on_mark: bool | None = None


def score_scene(
    track: SceneTrack,
    layout: TagLayout,
    *,
    begin_s: float | None = None,
    end_s: float | None = None,
    harm_m: float = 0.006,
    mark_m: tuple[float, float] | None = None,
) -> SceneOutcome:
    """Score a trial by rule.

    ``begin_s`` and ``end_s`` are on the video's clock; ``None`` is the first and the last picture. ``harm_m``
    is the narrowing from which the object counts as deformed. ``mark_m`` is the second mark, on which the
    object is to be put down: x and y from the first one in the table's axes; ``None`` where it is not asked
    for. One that is no place on the table raises :class:`InvalidValueError`. See also :func:`righted`.
    """
    if mark_m is not None:
        checked_mark(mark_m)
    begin_s = float(track.t_s[0]) if begin_s is None else begin_s
    end_s = float(track.t_s[-1]) if end_s is None else end_s
    track = righted(track, layout, begin_s=begin_s)
    courses = scene_courses(track, layout, begin_s=begin_s, end_s=end_s)
    ruling = SceneRule(courses, harm_m, window_s=begin_s + LIFT_WINDOW_S)
    ruling.go()
    inside = (track.t_s >= begin_s) & (track.t_s <= end_s)
    at = track.object.position_m[inside]
    seen = np.isfinite(at[:, 0])
    events = [ruling.measured(one.kind, one.t_s, one.size_m) for one in ruling.scorer.events]
    rest = None
    if not ruling.aloft:
        rest = resting(
            track, layout, stood_s=ruling.stands_s[-1] if ruling.stands_s else begin_s, end_s=end_s
        )
    on_mark = None if mark_m is None else _on_mark(ruling, rest, mark_m)
    off_mark_m, off_mark_error_m = (None, None) if rest is None or mark_m is None else rest.off(mark_m)
    events += _put_down(ruling, rest, mark_m, on_mark=on_mark)
    events.sort(key=lambda event: event.t_s)
    grip = np.array([0, 0, layout.object.grip_mm / 1000])
    sure = inside & placed(track.object, grip)
    cov = track.object.point(grip)[1][
        sure if sure.any() else inside & np.isfinite(track.object.position_m[:, 0])
    ]
    along = np.sqrt(np.einsum("i,nij,j->n", track.view, cov, track.view))
    across = np.sqrt(np.maximum(0, np.trace(cov, axis1=1, axis2=2) - along**2) / 2)
    times = track.t_s[inside][seen]
    gap_s = float(np.diff(times).max()) if len(times) > 1 else end_s - begin_s
    narrow = -courses.width.value
    widest = int(np.nanargmax(narrow)) if np.isfinite(narrow).any() else None
    notes = []
    if track.n_moved:
        notes.append(
            f"the camera was pushed: the table's tags moved in {track.n_moved} pictures that were looked at"
        )
    if gap_s > _GAP_S:
        notes.append(f"the object was out of sight for {gap_s:.2f} s")
    hand_seen = float(np.isfinite(track.hand.position_m[inside, 0]).mean())
    if hand_seen < 0.5:
        notes.append(f"the hand was seen in {hand_seen:.0%} of the pictures: slips and drops may be missing")
    width = np.isfinite(track.object.width_m)
    if widest is not None and not (width & (track.t_s >= begin_s) & (track.t_s <= begin_s + REST_S)).any():
        notes.append(
            "the width's tags were not seen before the touch: every width is off by how they are folded"
        )
    if rest is None and ruling.stands_s and not ruling.aloft:
        notes.append("the object was not seen where it was put down")
    elif rest is not None and mark_m is not None and rest.let_go is None:
        notes.append(
            "the hand was not seen after the object was put down: whether it has let go is not known"
        )
    return SceneOutcome(
        events=tuple(events),
        success=ruling.scorer.success and on_mark is not False,
        slid_m=ruling.scorer.slid_m,
        slid_error_m=float(np.nanmedian(courses.slip.error) * np.sqrt(2)),
        narrowing_m=None if widest is None else max(0.0, float(narrow[widest])),
        narrowing_error_m=None if widest is None else float(courses.width.error[widest]),
        height_m=float(np.nanmax(courses.height.value)),
        along_mm=float(1000 * np.median(along)),
        across_mm=float(1000 * np.median(across)),
        seen=float(seen.mean()),
        placed=float(sure[inside].mean()),
        hand_seen=hand_seen,
        longest_gap_s=gap_s,
        notes=tuple(notes),
        rest=rest,
        off_mark_m=off_mark_m,
        off_mark_error_m=off_mark_error_m,
        on_mark=on_mark,
    )


class SceneRule:
    """Feeds the measured courses to the rule of a trial, moment by moment.

    ``harm_m`` is the narrowing from which the object counts as deformed, ``window_s`` the end of the window
    of the lift on the video's clock. The ``scorer``'s times are the video's. ``stands_s`` are times at which
    the object stood again after it had left the table; ``aloft`` is whether it is off the table.
    """

    def __init__(self, courses: SceneCourses, harm_m: float, *, window_s: float = LIFT_WINDOW_S) -> None:
        self._courses = courses
        self.scorer = TrialScorer(harm_m, window_s=window_s)
        self.stands_s: list[float] = []
        self.aloft = False

    def go(self) -> None:
        """Feed all moments."""
        courses = self._courses
        dropped = False
        reference_m = off_s = 0.0
        sustained = round(_SUSTAINED_S / GRID_S)
        off = courses.lowest.value > OFF_M
        for k, t_s in enumerate(courses.t_s.tolist()):
            if not self.aloft and off[k] and off[k : k + sustained].all():
                self.aloft, reference_m, off_s = True, float(courses.slip.value[k]), t_s
            elif self.aloft and courses.lowest.value[k] < STANDS_M:
                self.aloft = False
                self.stands_s.append(t_s)
            # While the hand takes the load over the object still gives; a slip that goes on then began with the
            # lift-off, and all of its way counts.
            carried = self.aloft and t_s > off_s + _TAKEN_S
            slip_m = float(courses.slip.value[k]) - reference_m if carried else 0.0
            if not np.isfinite(slip_m):
                slip_m = self.scorer.slid_m
            dropped = dropped or slip_m > LOST_M
            narrow = float(courses.width.value[k])
            truth = WorldTruth(
                t_s=t_s,
                object_height_m=float(courses.height.value[k]),
                lift_off=self.aloft,
                pad_force_n=(0.0, 0.0, 0.0, 0.0),
                slip_m=slip_m,
                slip_m_s=float(np.nan_to_num(courses.slip.slope[k])) if carried else 0.0,
                deformation_m=-narrow if np.isfinite(narrow) else 0.0,
                damage_m=0.0,
                dropped=dropped,
                hand_to_object_m=0.0,
            )
            self.scorer.take(t_s, truth, placing=False)
        self.scorer.close()

    def measured(
        self, kind: Literal["lift_off", "lifted", "slip", "deformation", "drop"], t_s: float, size_m: float
    ) -> SceneEvent:
        """Return an event with its errors: that of what crossed a threshold, over the speed at which it did."""
        courses = self._courses
        k = int(np.clip(np.searchsorted(courses.t_s, t_s), 0, len(courses.t_s) - 1))
        course = {
            "lift_off": courses.lowest,
            "lifted": courses.height,
            "slip": courses.slip,
            "drop": courses.slip,
            "deformation": courses.width,
        }[kind]
        speed = max(abs(float(course.slope[k])), 0.005)
        error_m = float(course.error[k])
        size_error_m = {"slip": np.sqrt(2) * error_m, "deformation": error_m}.get(kind, 0.0)
        return SceneEvent(kind, t_s, float(np.hypot(error_m / speed, GRID_S)), size_m, float(size_error_m))


def _on_mark(ruling: SceneRule, rest: SceneRest | None, mark_m: tuple[float, float]) -> bool:
    """Whether the object was put down on a mark, and not dropped."""
    lost = ruling.scorer.time_of("drop") is not None
    return bool(ruling.stands_s) and not lost and rest is not None and rest.stands(mark_m)


def _put_down(
    ruling: SceneRule, rest: SceneRest | None, mark_m: tuple[float, float] | None, *, on_mark: bool | None
) -> list[SceneEvent]:
    """Return when the object stood again at last, after it was lifted, and when it had stood on the second mark."""
    if rest is None or not ruling.stands_s:
        return []
    away, lifted_s = rest.off(mark_m or (0.0, 0.0)), ruling.scorer.time_of("lifted")
    events = []
    stood_s = ruling.stands_s[-1]
    if lifted_s is not None and stood_s > lifted_s and ruling.scorer.time_of("drop") is None:
        events.append(SceneEvent("put_down", stood_s, GRID_S, *away))
    if on_mark:
        events.append(SceneEvent("placed", rest.since_s + STABLE_S, rest.error_s, *away))
    return events
