"""Bring a trial's poses into the courses that the rule judges: heights, slip and width over time, and where it stands.

Heights and width are smoothed by straight lines about each moment, slip by few pieces of parabolas, which neither smear
the beginning of a fall nor take noise for motion (:mod:`tega_scene.smoothing`). All are evaluated a hundred times a
second. The limits of standing are those of a simulated trial's truth (:mod:`tega_sim.score`). A camera cannot sense
fingers: an object that was put down counts as let go once the hand has moved away.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega.stages.events.outcomes import STABLE_S
from tega_scene.layout import TagBody, TagLayout
from tega_scene.smoothing import Course, joined, smoothed, trended, where_seen
from tega_scene.track import BodyTrack, SceneTrack
from tega_sim.score import ON_MARK_M, REST_M_S, UPRIGHT

LOST_M: Final = 0.03
"""Way of the object against the palm from which the hand does not hold it, metres."""

PLACED_M: Final = 2e-3
"""Standard error of the object's place, in its worst direction, beyond which a picture is not asked where it is: most
of it is hidden, or smeared by a fall."""

TALL_M: Final = 0.3e-3
"""Standard error, thought likely, of the height over the table at which the layout says the object's tags are."""

GRID_S: Final = 0.01
"""Seconds between two moments of a course."""
REST_S: Final = 0.6
"""Seconds from a trial's start for which the object stands untouched."""

_ALONG_M, _ACROSS_M = 1.5e-3, 0.2e-3
_FARTHEST_MARK_M: Final = 1.0
_STILL_M: Final = REST_M_S * STABLE_S
_SIGHTS: Final = 5


class SceneRest(msgspec.Struct, frozen=True, kw_only=True):
    """Where the object stands in the end.

    Attributes:
        at_mm: Its grip point over the table, x and y from the first mark.
        error_mm: Standard errors of that.
        lean_deg: How far its axis is from upright.
        since_s: From when on it was no farther from there than 2 mm, on the video's clock.
        error_s: Standard error of that.
        stood_s: How long that was.
        let_go: Whether the hand has gone away from it since; ``None`` where the hand was not seen.
    """

    at_mm: tuple[float, float]
    error_mm: tuple[float, float]
    lean_deg: float
    since_s: float
    error_s: float
    stood_s: float
    let_go: bool | None

    def off(self, mark_m: tuple[float, float]) -> tuple[float, float]:
        """Return how far it is from a mark, and the standard error of that, metres."""
        away = np.array(self.at_mm) / 1000 - mark_m
        off_m = float(np.hypot(*away))
        return off_m, float(np.hypot(*(away / max(off_m, 1e-9) * self.error_mm))) / 1000

    def said(self) -> str:
        """Return it in words."""
        x, y = (f"{at:.2f} ± {error:.2f}" for at, error in zip(self.at_mm, self.error_mm, strict=True))
        hand = {True: "let go of", False: "the hand still at it", None: "the hand not seen"}[self.let_go]
        return f"stands at {x} mm, {y} mm, {self.lean_deg:.1f}° from upright, still for {self.stood_s:.2f} s, {hand}"

    def stands(self, mark_m: tuple[float, float]) -> bool:
        """Whether it stands on a mark by the rule of a simulated trial; it has to have been carried there."""
        return (
            self.off(mark_m)[0] <= ON_MARK_M
            and math.cos(math.radians(self.lean_deg)) > UPRIGHT
            and self.stood_s >= STABLE_S
            and self.let_go is not False
        )


def checked_mark(mark_m: tuple[float, float]) -> tuple[float, float]:
    """Return a second mark that can be on the table, x and y from the first one.

    No number, or one farther away than a table that a camera sees, raises :class:`InvalidValueError`.
    """
    x_mm, y_mm = (1000 * value for value in mark_m)
    if not (math.isfinite(x_mm) and math.isfinite(y_mm)):
        raise InvalidValueError(
            f"the mark at {x_mm:g}, {y_mm:g} mm is not a place", "give x and y in millimetres"
        )
    if math.hypot(*mark_m) > _FARTHEST_MARK_M:
        raise InvalidValueError(
            f"the mark at {x_mm:g}, {y_mm:g} mm is not on the table: it is more than "
            f"{1000 * _FARTHEST_MARK_M:g} mm from the first one",
            "x and y are millimetres from the middle of the table's sheet, along its axes",
        )
    return mark_m


def placed(pose: BodyTrack, at_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which pictures place a point of a body to :data:`PLACED_M`, bool (n,)."""
    _, cov = pose.point(at_m)
    return np.asarray(np.linalg.eigvalsh(np.nan_to_num(cov, nan=1.0))[:, -1] <= PLACED_M**2)


def likely_error(ray: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the likely covariance, float64 (3, 3), m², of where all pictures have the object's tags.

    A box is never folded as drawn: it looks larger or smaller, which is along the view, and less so across
    it. ``ray`` is the direction from the camera to them, float64 (3,), of length 1.
    """
    along, across = _ALONG_M**2, _ACROSS_M**2
    return (along - across) * np.outer(ray, ray) + across * np.eye(3)


def resting(track: SceneTrack, layout: TagLayout, *, stood_s: float, end_s: float) -> SceneRest | None:
    """Return where the object stands at the end, by the pictures of the last second; ``None`` if unseen then.

    ``track`` is :func:`tega_scene.courses.righted`; ``stood_s``, when it was put down, and ``end_s``, the
    trial's end, are on the video's clock.
    """
    t_s, thing = track.t_s, track.object
    grip = np.array([0, 0, layout.object.grip_mm / 1000])
    at, cov = thing.point(grip)
    seen = np.isfinite(at[:, 0]) & (t_s <= end_s)
    late = seen & (t_s >= max(stood_s, end_s - STABLE_S))
    sure = late & placed(thing, grip)
    then = sure if sure.any() else late
    if not then.any():
        return None
    place = np.median(at[then], axis=0)
    # What is left of the error that all pictures have when the object was set on the table at the start.
    ray = (place - track.eye_m) / np.linalg.norm(place - track.eye_m)
    likely = likely_error(ray)
    left = likely - np.outer(likely[2], likely[2]) / (likely[2, 2] + TALL_M**2)
    spread = np.sqrt(np.diag(np.median(cov[then], axis=0) + left))

    grid = np.arange(stood_s, end_s, GRID_S)
    error = np.sqrt(np.maximum(cov[:, (0, 1), (0, 1)], 0))
    x, y = (smoothed(t_s[seen], at[seen, k], error[seen, k], grid) for k in (0, 1))
    moves = np.flatnonzero(np.hypot(x.value - place[0], y.value - place[1]) > _STILL_M)
    since_s, error_s = stood_s, GRID_S
    if len(moves):
        last = int(moves[-1])
        since_s = min(float(grid[last]) + GRID_S, end_s)
        speed = max(float(np.hypot(x.slope[last], y.slope[last])), REST_M_S)
        error_s = float(np.hypot(np.hypot(x.error[last], y.error[last]) / speed, GRID_S))
    lean = np.median(thing.rotation[then, 2, 2])
    return SceneRest(
        at_mm=(float(1000 * place[0]), float(1000 * place[1])),
        error_mm=(float(1000 * spread[0]), float(1000 * spread[1])),
        lean_deg=float(np.degrees(np.arccos(np.clip(lean, -1, 1)))),
        since_s=since_s,
        error_s=error_s,
        stood_s=end_s - since_s,
        let_go=_let_go(track, at, stood_s=stood_s, end_s=end_s),
    )


def _let_go(track: SceneTrack, at: NDArray[np.float64], *, stood_s: float, end_s: float) -> bool | None:
    """Whether the hand went away from where it had the object when that was put down."""
    between = track.hand.position_m - at
    seen = np.isfinite(between[:, 0])
    before, after = (
        between[seen & (track.t_s <= stood_s)][-_SIGHTS:],
        between[seen & (track.t_s > stood_s) & (track.t_s <= end_s)][-_SIGHTS:],
    )
    if not len(before) or not len(after):
        return None
    return bool(np.linalg.norm(np.median(after, axis=0) - np.median(before, axis=0)) > LOST_M)


class SceneCourses(NamedTuple):
    """Courses of height, slip and width that the rule judges, n moments.

    Attributes:
        t_s: float64 (n,), a hundred a second.
        height: Height of the object's grip point over its place at the start, metres.
        lowest: Height of the lowest point of its base over its place at the start, metres. It is straight
            from frame to frame, since a fitted line would blur the moment of lift-off.
        slip: How far its grip point is lower than the palm, against the start, metres.
        width: How much wider it is than untouched, metres.
    """

    t_s: NDArray[np.float64]
    height: Course
    lowest: Course
    slip: Course
    width: Course


def righted(track: SceneTrack, layout: TagLayout, *, begin_s: float) -> SceneTrack:
    """Return poses of an object that stands upright on the table while it rests at the trial's start.

    A box on its lid is never quite parallel to it: the tilt at rest is removed, about the middle of its tags.
    The base is then over or under the table by the error of the place, nearly all of it along the view. It is
    moved along the view by that part (conditional mean of a normal error), and by the remainder straight
    down. An object not seen at the start raises :class:`RecordingError`: there is nothing to measure against.
    """
    body = track.object
    rest = (track.t_s >= begin_s) & (track.t_s <= begin_s + REST_S) & np.isfinite(body.position_m[:, 0])
    if rest.sum() < 3:
        raise RecordingError(
            f"the object's tags are seen in {rest.sum()} pictures of the trial's first {REST_S} s, 3 are needed",
            "leave the object untouched and in sight when the trial begins",
        )
    turn = body.rotation[rest]
    up = np.median(turn[:, 2], axis=0)  # the table's up in the body's axes
    up /= np.linalg.norm(up)
    # The shortest turn that brings the body's axis there (Rodrigues, for the cross product of both).
    axis = np.cross((0, 0, 1.0), up)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    right = np.eye(3) + cross + cross @ cross / (1 + up[2])
    middle = np.mean([tag.at_mm for tag in layout.object.all_tags() if not any(tag.slides)], axis=0) / 1000
    position = body.position_m + body.rotation @ (middle - right @ middle)
    ray = np.median(position[rest], axis=0) + middle - track.eye_m
    ray /= np.linalg.norm(ray)
    likely = likely_error(ray)
    position -= np.median(position[rest, 2]) * likely[:, 2] / (likely[2, 2] + TALL_M**2)
    position[:, 2] -= np.median(position[rest, 2])
    return track._replace(object=body._replace(position_m=position, rotation=body.rotation @ right))


def scene_courses(track: SceneTrack, layout: TagLayout, *, begin_s: float, end_s: float) -> SceneCourses:
    """Return the rule's input from poses that are :func:`righted`.

    Times are on the video's clock; the object stands untouched for a moment from ``begin_s`` on.
    """
    t_s, thing = track.t_s, track.object
    grip, grip_error = heights(track, thing, layout.object, np.array([0, 0, layout.object.grip_mm / 1000]))
    base, base_error = heights(track, thing, layout.object, np.zeros(3))
    lowest = base - layout.object.base_mm / 2000 * np.sqrt(np.clip(1 - thing.rotation[:, 2, 2] ** 2, 0, 1))
    rest = (t_s >= begin_s) & (t_s <= begin_s + REST_S) & np.isfinite(grip)
    grid = np.arange(begin_s, end_s, GRID_S)
    palm, palm_error = np.full((2, len(t_s)), np.nan)
    if layout.hand.all_tags():
        palm, palm_error = heights(track, track.hand, layout.hand, np.zeros(3))
    width = thing.width_m - (
        np.nanmedian(thing.width_m[rest]) if np.isfinite(thing.width_m[rest]).any() else 0.0
    )
    return SceneCourses(
        grid,
        smoothed(t_s, grip - np.median(grip[rest]), grip_error, grid),
        joined(t_s, lowest - np.median(lowest[rest]), base_error, grid),
        trended(t_s, palm - grip, np.hypot(grip_error, palm_error), grid),
        where_seen(t_s[np.isfinite(width)], grid, smoothed(t_s, width, thing.width_error_m, grid)),
    )


def heights(
    track: SceneTrack, pose: BodyTrack, body: TagBody, at_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a point's height over the table in each picture, and its standard error, float64 (n,), metres.

    A camera measures positions across its view some ten times better than along it, and looks down, so noise
    along the view enters the height. But an object's distance from the camera on level ground hardly changes
    while it is lifted, slips or falls. That distance is smoothed over time, and the height is taken where
    each frame's ray, the one to the middle of the body's tags, has that distance. ``at_m`` is float64 (3,),
    in the body's axes.
    """
    middle = np.mean([tag.at_mm for tag in body.all_tags() if not any(tag.slides)], axis=0) / 1000
    place, cov = pose.point(middle)
    from_eye = place - track.eye_m
    away = np.hypot(from_eye[:, 0], from_eye[:, 1])
    level = np.zeros_like(from_eye)
    level[:, :2] = from_eye[:, :2] / away[:, None]
    grid = np.arange(track.t_s[0], track.t_s[-1] + GRID_S, GRID_S)
    steady = trended(track.t_s, away, np.sqrt(np.einsum("ni,nij,nj->n", level, cov, level)), grid)
    drop = from_eye[:, 2] / away
    across = np.array([0, 0, 1.0]) - drop[:, None] * level
    arm = pose.rotation @ (at_m - middle)
    turn = np.column_stack([arm[:, 1], -arm[:, 0]])  # how a small turn about x and y moves its end up
    variance = np.einsum("ni,nij,nj->n", across, cov, across) + np.einsum(
        "ni,nij,nj->n", turn, pose.covariance[:, 3:5, 3:5], turn
    )
    height = track.eye_m[2] + drop * np.interp(track.t_s, grid, steady.value) + arm[:, 2]
    return height, np.sqrt(variance)
