"""Find where an object stands that was put down: where, since when, how far from its mark, upright, still, let go of.

The limits are those of a simulated trial's truth (:mod:`tega_sim.score`). A camera cannot sense fingers: the object
counts as let go once the hand has moved away.
"""

from __future__ import annotations

import math
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.stages.events.outcomes import STABLE_S
from tega_scene.layout import TagLayout
from tega_scene.smoothing import smoothed
from tega_scene.track import BodyTrack, SceneTrack
from tega_sim.score import ON_MARK_M, REST_M_S, UPRIGHT

LOST_M: Final = 0.03
"""Way of the object against the palm from which the hand does not hold it, metres."""

PLACED_M: Final = 2e-3
"""Standard error of the object's place, in its worst direction, beyond which a picture is not asked where it is: most
of it is hidden, or smeared by a fall."""

TALL_M: Final = 0.3e-3
"""Standard error, thought likely, of the height over the table at which the layout says the object's tags are."""

_ALONG_M, _ACROSS_M = 1.5e-3, 0.2e-3
_FARTHEST_MARK_M: Final = 1.0
_STILL_M: Final = REST_M_S * STABLE_S
_GRID_S: Final = 0.01
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

    grid = np.arange(stood_s, end_s, _GRID_S)
    error = np.sqrt(np.maximum(cov[:, (0, 1), (0, 1)], 0))
    x, y = (smoothed(t_s[seen], at[seen, k], error[seen, k], grid) for k in (0, 1))
    moves = np.flatnonzero(np.hypot(x.value - place[0], y.value - place[1]) > _STILL_M)
    since_s, error_s = stood_s, _GRID_S
    if len(moves):
        last = int(moves[-1])
        since_s = min(float(grid[last]) + _GRID_S, end_s)
        speed = max(float(np.hypot(x.slope[last], y.slope[last])), REST_M_S)
        error_s = float(np.hypot(np.hypot(x.error[last], y.error[last]) / speed, _GRID_S))
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
