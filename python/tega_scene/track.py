"""Follow table, hand and object through a video: poses against the table, and their errors.

Where a body's tags truly are is found from the video itself: boxes are never folded as they are drawn. Poses in some
dozens of pictures and a small shift and turn of every tag are fitted together (Gauss-Newton, dense), with the layout as
prior: tags stand where it says to 0.3 mm and 0.5°, one standard deviation. What stays unknown is how the whole set of
tags sits on its body; :mod:`tega_scene.outcomes` measures against the object at rest for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.arm.rotation import exp, to_matrix
from tega.errors import RecordingError
from tega_scene.corners import TagFinder
from tega_scene.layout import TagLayout
from tega_scene.lens import Lens
from tega_scene.pose import CORNER_PX, BodyFitter, FittedPose, corner_weights, residuals

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
            places[k] = position + one[:3], to_matrix(exp(one[3:])) @ rotation
        for number, tag in enumerate(tags):
            one = change[n_poses + 6 * number : n_poses + 6 * number + 6]
            moved[tag] = moved[tag] + one
            middle = now[tag].mean(0)
            now[tag] = (now[tag] - middle) @ to_matrix(exp(one[3:])).T + middle + one[:3]
    return now


_MARGIN_PX: Final = 70
_WHOLE_EVERY: Final = 30
"""Number of frames of which one is searched whole; in the others, only near the tags' last places."""
_MOVED_PX: Final = 2.0
_REFINED_STRANGE_PX: Final = 0.6


class BodyTrack(NamedTuple):
    """Poses of a body against the table over n pictures; not a number where it was not seen.

    Attributes:
        position_m: float64 (n, 3), of the body's origin.
        rotation: float64 (n, 3, 3), from the body's axes to the table's.
        covariance: float64 (n, 6, 6), of position (m²) and a small turn about the table's axes (rad²).
        n_tags: int (n,), tags that were used.
        width_m: float64 (n,), how much wider than untouched.
        width_error_m: float64 (n,), standard error of that.
        rms_px: float64 (n,), residual of the fit.
    """

    position_m: NDArray[np.float64]
    rotation: NDArray[np.float64]
    covariance: NDArray[np.float64]
    n_tags: NDArray[np.int64]
    width_m: NDArray[np.float64]
    width_error_m: NDArray[np.float64]
    rms_px: NDArray[np.float64]

    def point(self, at_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where a point of the body is, float64 (n, 3), and its covariance (n, 3, 3)."""
        arm = self.rotation @ at_m
        # A small turn w moves the point by w × arm.
        cross = np.zeros((len(arm), 3, 3))
        cross[:, 0, 1], cross[:, 0, 2] = arm[:, 2], -arm[:, 1]
        cross[:, 1, 0], cross[:, 1, 2] = -arm[:, 2], arm[:, 0]
        cross[:, 2, 0], cross[:, 2, 1] = arm[:, 1], -arm[:, 0]
        slope = np.concatenate([np.broadcast_to(np.eye(3), cross.shape), cross], axis=2)
        return self.position_m + arm, slope @ self.covariance @ slope.transpose(0, 2, 1)


class SceneTrack(NamedTuple):
    """Poses of object and hand in n pictures.

    Attributes:
        t_s: float64 (n,), times of the pictures.
        view: float64 (3,), direction in which the camera looks, in the table's axes.
        eye_m: float64 (3,), where it stands.
        n_moved: Pictures in which all of the table's tags, two or more, stood more than two pixels off: the
            camera was pushed.
    """

    t_s: NDArray[np.float64]
    object: BodyTrack
    hand: BodyTrack
    view: NDArray[np.float64]
    eye_m: NDArray[np.float64]
    n_moved: int


class SceneSightings(NamedTuple):
    """Tags that were seen in n pictures, their times rising.

    ``corners`` are (4, 2) pixels by tag, for each picture. Tags of the table are present only now and then.
    """

    t_s: list[float]
    corners: list[dict[int, NDArray[np.float64]]]


def track_scene(
    pictures: Iterable[tuple[float, NDArray[np.uint8]]], lens: Lens, layout: TagLayout
) -> SceneTrack:
    """Follow the bodies of a layout through pictures: :func:`sight_tags`, then :func:`follow_bodies`.

    ``pictures`` are time in seconds, rising, and uint8 (H, W) or (H, W, 3). :class:`RecordingError`: there is
    none, one has another size than the lens was calibrated for, or the table's tags are never seen.
    """
    return follow_bodies(sight_tags(pictures, lens, layout), lens, layout)


def sight_tags(
    pictures: Iterable[tuple[float, NDArray[np.uint8]]], lens: Lens, layout: TagLayout
) -> SceneSightings:
    """Find the tags of a layout in pictures, which are looked at whole only now and then or when a body is lost.

    Arguments and errors as of :func:`track_scene`.
    """
    tags = {name: body.all_tags() for name, body in layout.bodies().items()}
    finder = TagFinder(layout.family, frozenset(tag.id for some in tags.values() for tag in some))
    moving = frozenset(tag.id for name in ("object", "hand") for tag in tags[name])
    # By tags that slide alone no pose is known: the others may be beyond the part that is looked at.
    firm = [{tag.id for tag in tags[name] if not any(tag.slides)} for name in ("object", "hand")]
    sightings = SceneSightings([], [])
    seen: dict[int, NDArray[np.float64]] = {}
    for number, (t_s, image) in enumerate(pictures):
        if image.shape[:2] != (lens.height, lens.width):
            raise RecordingError(
                f"picture {number} is {image.shape[1]}×{image.shape[0]}, the lens was calibrated at "
                f"{lens.width}×{lens.height}",
                "record at that resolution, or calibrate at this one",
            )
        around = [corners for tag, corners in seen.items() if tag in moving]
        whole = number % _WHOLE_EVERY == 0 or any(some and not some & seen.keys() for some in firm)
        seen = finder.find(image, within=None if whole else _around(around, lens))
        sightings.t_s.append(t_s)
        sightings.corners.append(seen)
    if not sightings.t_s:
        raise RecordingError("the video has no pictures")
    return sightings


def follow_bodies(sightings: SceneSightings, lens: Lens, layout: TagLayout) -> SceneTrack:
    """Fit the bodies of a layout to the tags that were seen.

    The table's tags are taken over all pictures together: the camera stands still. Where each tag truly sits
    on its body is found from the pictures, too (:mod:`tega_scene.track`). Tags of the table that are never
    seen raise :class:`RecordingError`.
    """
    fitters = {name: BodyFitter(body, lens) for name, body in layout.bodies().items()}
    table_ids = fitters["table"].ids
    tables = ({tag: at for tag, at in one.items() if tag in table_ids} for one in sightings.corners)
    lying = [table for table in tables if table]
    middle = {
        tag: np.median([one[tag] for one in lying if tag in one], axis=0)
        for tag in sorted(frozenset().union(*lying) if lying else ())
    }
    table_pose = fitters["table"].fit(middle)
    if table_pose is None:
        raise RecordingError(
            "none of the table's tags is seen, so nothing says where up is",
            f"are tags {', '.join(map(str, sorted(table_ids)))} in the picture, flat, with their white margin?",
        )
    moved = sum(
        min(float(np.abs(corners - middle[tag]).max()) for tag, corners in one.items()) > _MOVED_PX
        for one in lying
        if len(one) > 1
    )
    found: dict[str, list[FittedPose | None]] = {}
    for name in ("object", "hand"):
        fitter = fitters[name]
        poses, fitter.strange_px = _fitted(fitter, sightings), _REFINED_STRANGE_PX
        fitter.corners_m = refined_corners(fitter.corners_m, sightings.corners, poses, lens)
        found[name] = _fitted(fitter, sightings)
    up = table_pose.rotation.T
    return SceneTrack(
        np.array(sightings.t_s),
        _against_table(found["object"], table_pose),
        _against_table(found["hand"], table_pose),
        up[:, 2],
        -up @ table_pose.position_m,
        moved,
    )


def _fitted(fitter: BodyFitter, sightings: SceneSightings) -> list[FittedPose | None]:
    before: FittedPose | None = None
    poses = []
    for seen in sightings.corners:
        poses.append(fitter.fit(seen, before))
        before = poses[-1] or before
    return poses


def _around(corners: list[NDArray[np.float64]], lens: Lens) -> tuple[int, int, int, int]:
    places = np.concatenate(corners)
    left, top = np.maximum(places.min(0) - _MARGIN_PX, 0).astype(int).tolist()
    right, bottom = (places.max(0) + _MARGIN_PX).astype(int).tolist()
    return left, top, min(right, lens.width), min(bottom, lens.height)


def _against_table(poses: list[FittedPose | None], table: FittedPose) -> BodyTrack:
    n = len(poses)
    unknown = partial(np.full, fill_value=np.nan)
    track = BodyTrack(
        unknown((n, 3)), unknown((n, 3, 3)), unknown((n, 6, 6)), np.zeros(n, np.int64), *unknown((3, n))
    )
    up = table.rotation.T
    both = np.kron(np.eye(2), up)
    # One tag alone leaves two residuals, which are small by chance now and then: no picture is better than most.
    usual_px = float(np.median([pose.rms_px for pose in poses if pose and pose.n_tags > 1] or [CORNER_PX]))
    for k, pose in enumerate(poses):
        if pose is None:
            continue
        too_small = max(1.0, usual_px / max(pose.rms_px, CORNER_PX)) ** 2
        track.position_m[k] = up @ (pose.position_m - table.position_m)
        track.rotation[k] = up @ pose.rotation
        track.covariance[k] = too_small * both @ pose.covariance @ both.T
        track.n_tags[k] = pose.n_tags
        track.width_m[k], track.width_error_m[k] = pose.width_m, pose.width_error_m
        track.rms_px[k] = pose.rms_px
    return track
