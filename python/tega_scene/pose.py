"""Fit the pose of a body to the corners of all its tags at once, with its error.

Least squares of the reprojection error (Gauss-Newton with damping) over position and rotation; tags that slide with
the object's width are measured against that pose. The covariance is the inverse of the normal matrix times the
corners' variance, taken from the residuals, but with at least :data:`CORNER_PX` of error.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tega.arm.rotation import exp, to_matrix
from tega.runtime.opencv import load_cv2
from tega_scene.layout import TagBody
from tega_scene.lens import Lens

Floats: TypeAlias = NDArray[np.float64]

CORNER_PX: Final = 0.05
"""Least error of a corner in a fit, pixels: errors common to all corners do not show in the residuals."""

_STEPS: Final = 30
STRANGE_PX: Final = 1.5
"""Residual from which a tag is left out: half hidden, misread, or elsewhere than the layout says."""


_WIDE_PX: Final = 40.0
"""Width of a tag, where it is narrowest, from which its corners are as good as they get. Of narrower ones the lens's
blur runs both edges of the black border into one another: with the blur of `dim` (docs/evidence/scene.md) corners were
off by 0.1 px at 40 px, 0.2 px at 32, 0.4 px at 28, and 0.7 px at 25, by much the same in picture after picture."""


class FittedPose(NamedTuple):
    """Pose of a body in the camera's axes: x right, y down, z along the view.

    Attributes:
        position_m: float64 (3,), where the body's origin is.
        rotation: float64 (3, 3), from the body's axes to the camera's.
        covariance: float64 (6, 6), of position (m²) and of a small turn about the camera's axes (rad²).
        rms_px: Root mean square of the corners' residuals.
        n_tags: Tags that were used.
        width_m: How much wider the object is than untouched; not a number where its tags are not seen.
        width_error_m: Standard error of that.
    """

    position_m: Floats
    rotation: Floats
    covariance: Floats
    rms_px: float
    n_tags: int
    width_m: float = float("nan")
    width_error_m: float = float("nan")


class _Sight(NamedTuple):
    """Corners of n / 4 tags: float64 (n, 3) in the body's axes, (n, 2) at depth 1, and weights (2 n,)."""

    points: Floats
    rays: Floats
    weights: Floats

    def residuals(self, position: Floats, rotation: Floats) -> tuple[Floats, Floats]:
        """Return :func:`residuals` times weights, (2 n,) and (2 n, 6)."""
        left, slope = residuals(self.points, self.rays, position, rotation)
        return left * self.weights, slope * self.weights[:, None]


class BodyFitter:
    """Fits the poses of one body, whose tags are ``ids``.

    ``corners_m``, float64 (4, 3) by number, in the body's axes, are those of tags that do not slide; they may
    be replaced. ``strange_px`` is the residual from which a tag is left out.
    """

    def __init__(self, body: TagBody, lens: Lens) -> None:
        self._lens = lens
        self.strange_px = STRANGE_PX
        self._cv2 = load_cv2("scene")
        tags = body.all_tags()
        self.ids = frozenset(tag.id for tag in tags)
        self.corners_m = {tag.id: tag.corners_m() for tag in tags if not any(tag.slides)}
        # Of a tag that slides only the middle counts: the wall that it is on tilts as it gives.
        self._sliding = {
            tag.id: (np.array(tag.at_mm) / 1000, np.array(tag.slides) / 2) for tag in tags if any(tag.slides)
        }

    def fit(self, seen: dict[int, Floats], before: FittedPose | None = None) -> FittedPose | None:
        """Return the pose; ``None`` where no tag of the body is seen, or none fits.

        ``seen`` are corners by tag, (4, 2) pixels, as of :meth:`~tega_scene.corners.TagFinder.find`.
        ``before`` is the pose in the picture before: with one tag alone two turns fit nearly as well, and the
        one nearer to it is taken.
        """
        used = [number for number in self.corners_m if number in seen]
        while used:
            found = self._fit_rigid(used, seen, before)
            if found is None:
                return None
            sight, position, rotation, left = found
            worst = int(np.argmax(left))
            if left[worst] <= self.strange_px or len(used) == 1:
                break
            del used[worst]
        if not used or left[worst] > 2 * self.strange_px:
            return None
        return self._with_width(sight, seen, position, rotation)

    def _fit_rigid(
        self, used: list[int], seen: dict[int, Floats], before: FittedPose | None
    ) -> tuple[_Sight, Floats, Floats, Floats] | None:
        """Return the corners, position, rotation, and each tag's largest residual, pixels."""
        sight = _Sight(
            np.concatenate([self.corners_m[number] for number in used]),
            self._lens.rays(np.concatenate([seen[number] for number in used])),
            np.concatenate([corner_weights(seen[number]) for number in used]),
        )
        starts = [] if before is None else [(before.rotation, before.position_m)]
        best: tuple[float, Floats, Floats, Floats] | None = None
        for turn, shift in (*starts, *_first_poses(self._cv2, sight, flat=len(used) == 1)):
            refined = _refine(sight, shift, turn)
            if refined is None:
                continue
            position, rotation, left = refined
            cost = float((left**2).sum())
            if best is None or cost < best[0] * (0.5 if before is not None else 1):
                best = cost, position, rotation, left / sight.weights
        if best is None:
            return None
        _, position, rotation, left = best
        return sight, position, rotation, np.abs(left.reshape(len(used), -1)).max(1) * self._lens.fx

    def _with_width(
        self, sight: _Sight, seen: dict[int, Floats], position: Floats, rotation: Floats
    ) -> FittedPose | None:
        """Add to the pose its covariance, and the width as measured against it.

        The tags of the width have no say in the pose: how they sit on their stalks would move it when one is
        hidden.
        """
        left, slope = sight.residuals(position, rotation)
        rms_px = float(np.sqrt((left**2).sum() / max(1, len(left) - 6))) * self._lens.fx
        normal = slope.T @ slope
        if np.linalg.cond(normal) > 1e14:
            return None
        sigma = max(rms_px, CORNER_PX) / self._lens.fx
        covariance = np.asarray(np.linalg.inv(normal) * sigma**2, np.float64)
        width, width_error = self._width(seen, position, rotation, covariance, sigma)
        return FittedPose(position, rotation, covariance, rms_px, len(sight.points) // 4, width, width_error)

    def _width(
        self, seen: dict[int, Floats], position: Floats, rotation: Floats, covariance: Floats, sigma: float
    ) -> tuple[float, float]:
        """Return how much wider the object is than untouched, and its standard error, metres."""
        moving = [number for number in self._sliding if number in seen]
        if len(moving) < 2:
            return float("nan"), float("nan")
        rays = self._lens.rays(np.array([_middle(seen[number]) for number in moving]))
        points = np.array([self._sliding[number][0] for number in moving])
        left, slope = residuals(points, rays, position, rotation)
        ways = np.array([self._sliding[number][1] for number in moving]) @ rotation.T
        along = _along(ways, points, position, rotation)
        share = -along / (along @ along)
        spread = (share @ share) * sigma**2 + share @ slope @ covariance @ slope.T @ share
        return float(share @ left), float(np.sqrt(spread))


def corner_weights(corners: Floats) -> Floats:
    """Return a fit's weights of a tag's corner coordinates, (4, 2) pixels, as (8,); 1 for a wide tag."""
    (x1, y1), (x2, y2) = corners[2] - corners[0], corners[3] - corners[1]
    longest = max(float(np.hypot(*(corners[k] - corners[k - 1]))) for k in range(4))
    narrow_px = float(abs(x1 * y2 - x2 * y1)) / 2 / longest
    return np.full(8, min(1.0, narrow_px / _WIDE_PX) ** 4)


def _middle(corners: Floats) -> Floats:
    """Return where a tag's diagonals meet, which perspective leaves its middle."""
    a, b, c, d = corners
    matrix = np.column_stack([c - a, b - d])
    s = np.linalg.solve(matrix, b - a)[0]
    return np.asarray(a + s * (c - a))


def _first_poses(cv2: Any, sight: _Sight, *, flat: bool) -> list[tuple[Floats, Floats]]:
    points, rays = sight.points, sight.rays
    poses = []
    if flat:
        # The two turns of a flat square; its own axes are needed for that.
        middle = points.mean(0)
        x, y = points[1] - points[0], points[0] - points[3]
        side = float(np.linalg.norm(x))
        axes = np.column_stack([x / side, y / side, np.cross(x, y) / side**2])
        square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]]) * side / 2
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            square, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        for turn, shift in zip(turns, shifts, strict=True):
            rotation = cv2.Rodrigues(turn)[0] @ axes.T
            poses.append((rotation, shift.ravel() - rotation @ middle))
    else:
        ok, turns, shifts, _ = cv2.solvePnPGeneric(points, rays, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
        for turn, shift in zip(turns, shifts, strict=True) if ok else ():
            poses.append((cv2.Rodrigues(turn)[0], shift.ravel()))
    return poses


def _refine(sight: _Sight, position: Floats, rotation: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Return position, rotation and weighed residuals (2 n,) at depth 1, of their least sum of squares near a start."""
    damping = 1e-6
    left, slope = sight.residuals(position, rotation)
    cost = float(left @ left)
    for _ in range(_STEPS):
        normal = slope.T @ slope
        damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
        step = np.asarray(-np.linalg.solve(damped, slope.T @ left), np.float64)
        there, turned = position + step[:3], to_matrix(exp(step[3:])) @ rotation
        new, new_slope = sight.residuals(there, turned)
        new_cost = float(new @ new)
        if not np.isfinite(new_cost):
            return None
        if new_cost < cost:
            done = cost - new_cost < 1e-10 * cost
            position, rotation, left, slope, cost = there, turned, new, new_slope, new_cost
            damping = max(damping / 10, 1e-12)
            if done:
                break
        else:
            damping *= 10
            if damping > 1e3:
                break
    return (position, rotation, left) if position[2] > 0 else None


def residuals(points: Floats, rays: Floats, position: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Return where points are seen less where they were, (2 n,), and its slope over shift and small turn, (2 n, 6)."""
    arms = points @ rotation.T
    there = arms + position
    with np.errstate(divide="ignore", invalid="ignore"):
        deep = 1 / there[:, 2]
        left = (there[:, :2] * deep[:, None] - rays).ravel()
    shift = _per_metre(there, deep)
    turn = np.empty((len(points), 2, 3))
    turn[:, :, 0] = shift[:, :, 2] * arms[:, None, 1] - shift[:, :, 1] * arms[:, None, 2]
    turn[:, :, 1] = shift[:, :, 0] * arms[:, None, 2] - shift[:, :, 2] * arms[:, None, 0]
    turn[:, :, 2] = shift[:, :, 1] * arms[:, None, 0] - shift[:, :, 0] * arms[:, None, 1]
    return left, np.concatenate([shift, turn], axis=2).reshape(-1, 6)


def _per_metre(there: Floats, deep: Floats) -> Floats:
    """Return how the places at depth 1 change with the points, (n, 2, 3)."""
    slope = np.zeros((len(there), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = deep
    slope[:, :, 2] = -there[:, :2] * deep[:, None] ** 2
    return slope


def _along(ways: Floats, points: Floats, position: Floats, rotation: Floats) -> Floats:
    """Return the derivatives of the projected points along each point's direction, (2 n,)."""
    there = points @ rotation.T + position
    slope: Floats = np.einsum("nij,nj->ni", _per_metre(there, 1 / there[:, 2]), ways).ravel()
    return slope
