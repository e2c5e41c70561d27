"""Bring a trial's poses into the courses that the rule judges: heights, slip and width over time.

Heights and width are smoothed by straight lines about each moment, slip by few pieces of parabolas, which neither smear
the beginning of a fall nor take noise for motion (:mod:`tega_scene.smoothing`). All are evaluated a hundred times a
second.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega_scene.layout import TagBody, TagLayout
from tega_scene.resting import TALL_M, likely_error
from tega_scene.smoothing import Course, joined, smoothed, trended, where_seen
from tega_scene.track import BodyTrack, SceneTrack

GRID_S: Final = 0.01
"""Seconds between two moments of a course."""
REST_S: Final = 0.6
"""Seconds from a trial's start for which the object stands untouched."""


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
