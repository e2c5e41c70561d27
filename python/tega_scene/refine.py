"""Find where a body's tags truly are from the video itself: boxes are never folded as they are drawn.

Poses in some dozens of pictures and a small shift and turn of every tag are fitted together (Gauss-Newton, dense), with
the layout as prior: tags stand where it says to 0.3 mm and 0.5°, one standard deviation. What stays unknown is how the
whole set of tags sits on its body; :mod:`tega_scene.outcomes` measures against the object at rest for that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega_scene.lens import Lens
from tega_scene.pose import CORNER_PX, FittedPose, corner_weights, residuals, rotation_about

SHIFT_M: Final = 0.0003
TURN_RAD: Final = float(np.radians(0.5))
"""Errors of a folded box that are thought likely, one standard deviation."""

_MOST_PICTURES: Final = 60
_ROUNDS: Final = 6
_STRANGE_PX: Final = 0.5
_SPREAD_PX: Final = 2 * CORNER_PX
_NOTHING: Final = 1e-9
"""Added to the diagonal, so that a frame with all its tags left out stays unchanged."""


def refined_corners(
    corners_m: Mapping[int, NDArray[np.float64]],
    seen: Sequence[Mapping[int, NDArray[np.float64]]],
    poses: Sequence[FittedPose | None],
    lens: Lens,
) -> dict[int, NDArray[np.float64]]:
    """Return where the tags' corners are on the body, float64 (4, 3) by tag.

    They are the layout's own, ``corners_m``, (4, 3) by tag, where too few pictures show two tags at once.
    ``seen`` are each picture's corners, (4, 2) pixels by tag; ``poses`` the body's in each, by the layout.
    """
    tags = sorted(corners_m)
    useful = [
        (pose, [tag for tag in tags if tag in one], one)
        for one, pose in zip(seen, poses, strict=True)
        if pose is not None and sum(tag in one for tag in tags) >= 2
    ]
    if len(useful) < 5:
        return dict(corners_m)
    step = max(1, len(useful) // _MOST_PICTURES)
    useful = useful[::step][:_MOST_PICTURES]
    rays = [lens.rays(np.concatenate([one[tag] for tag in displayed])) for _, displayed, one in useful]
    weights = [
        np.concatenate([corner_weights(one[tag]) for tag in displayed]) for _, displayed, one in useful
    ]
    places = [(pose.position_m, pose.rotation) for pose, _, _ in useful]
    now = {tag: np.array(corners) for tag, corners in corners_m.items()}
    moved = {tag: np.zeros(6) for tag in tags}
    n_poses = 6 * len(useful)
    sigma = _SPREAD_PX / lens.fx
    prior = np.array([SHIFT_M] * 3 + [TURN_RAD] * 3)
    for round_ in range(_ROUNDS):
        rows, lefts = [], []
        for k, (_, displayed, _) in enumerate(useful):
            position, rotation = places[k]
            points = np.concatenate([now[tag] for tag in displayed])
            left, slope = residuals(points, rays[k], position, rotation)
            row = np.zeros((len(left), n_poses + 6 * len(tags)))
            row[:, 6 * k : 6 * k + 6] = slope
            per_point = slope[:, :3] @ rotation  # how what is seen changes as a point moves on the body
            for number, tag in enumerate(displayed):
                at = slice(8 * number, 8 * number + 8)
                if round_ >= _ROUNDS // 2 and np.abs(left[at]).max() * lens.fx > _STRANGE_PX:
                    left[at] = row[at] = 0.0  # half hidden there, or misread
                    continue
                begin = n_poses + 6 * tags.index(tag)
                arms = now[tag] - now[tag].mean(0)
                row[at, begin : begin + 3] = per_point[at]
                row[at, begin + 3 : begin + 6] = np.cross(np.repeat(arms, 2, axis=0), per_point[at])
            rows.append(row * (weights[k][:, None] / sigma))
            lefts.append(left * (weights[k] / sigma))
        rows.append(
            np.column_stack([np.zeros((6 * len(tags), n_poses)), np.diag(np.tile(1 / prior, len(tags)))])
        )
        lefts.append(np.concatenate([moved[tag] / prior for tag in tags]))
        matrix = np.concatenate(rows)
        # Columns of one length, so that the normal equations lose no digits; the prior makes them definite.
        scale = 1 / np.maximum(np.sqrt((matrix**2).sum(0)), 1e-12)
        matrix *= scale
        normal = matrix.T @ matrix + _NOTHING * np.eye(len(scale))
        change = -scale * np.linalg.solve(normal, matrix.T @ np.concatenate(lefts))
        for k, (position, rotation) in enumerate(places):
            one = change[6 * k : 6 * k + 6]
            places[k] = position + one[:3], rotation_about(one[3:]) @ rotation
        for number, tag in enumerate(tags):
            one = change[n_poses + 6 * number : n_poses + 6 * number + 6]
            moved[tag] = moved[tag] + one
            middle = now[tag].mean(0)
            now[tag] = (now[tag] - middle) @ rotation_about(one[3:]).T + middle + one[:3]
    return now
