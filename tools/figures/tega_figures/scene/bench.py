"""Set a rendered camera up before a simulated trial: tags on table, hand and object, and what hides them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np

from tega.arm.rotation import to_matrix
from tega.runtime.opencv import load_cv2
from tega_figures.scene.render import Face, Film, SceneCamera, tag_face
from tega_figures.scene.trials import TrueTrial
from tega_scene.layout import PlacedTag, TagBody, TagCube, TagLayout, example_layout
from tega_scene.lens import Lens, board_size_mm, charuco_board
from tega_sim.world.scene import PALM_ROTATION

if TYPE_CHECKING:
    from numpy.typing import NDArray

LENS: Final = Lens(1920, 1080, 1500.0, 1502.0, 958.0, 541.0, (-0.12, 0.05, 0.0006, -0.0004, 0.0), 0.0, 0)
"""A camera of 1920 × 1080 pixels whose lens sees 65° across: 1.28 m at a metre, 0.67 mm a pixel."""

EYE_M, AT_M = (0.58, 0.66, 0.72), (0.0, 0.03, 0.22)
WRIST_MM: Final = tuple((1000 * PALM_ROTATION.T @ np.array([0.09, -0.06, 0.10])).tolist())
"""Middle of the hand's box in the palm's axes: on a bracket above the knuckles."""

_GREY_TABLE, _GREY_ROOM = 82.0, 70.0


def camera_pose(
    eye_m: tuple[float, float, float] = EYE_M, at_m: tuple[float, float, float] = AT_M
) -> NDArray[np.float64]:
    """Return world to camera, float64 (3, 4), of a camera that is level."""
    forward = np.subtract(at_m, eye_m)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1.0))
    right /= np.linalg.norm(right)
    turn = np.array([right, np.cross(forward, right), forward])
    return np.column_stack([turn, -turn @ np.array(eye_m)])


def bench_layout(trial: TrueTrial) -> TagLayout:
    """Return where the tags of a trial are: as on the printed sheets, the hand's box at the wrist."""
    spec = trial.spec
    whole = example_layout(height_mm=1000 * spec.height_m, base_mm=1000 * spec.diameter_m)
    return msgspec.structs.replace(
        whole,
        hand=TagBody(cube=TagCube(20, 50.0, 38.0, WRIST_MM)),
    )


def _interpolated(t_s: NDArray[np.float64], poses: NDArray[np.float64], at_s: float) -> NDArray[np.float64]:
    """Return the pose (3, 4) between two moments."""
    cv2 = load_cv2("figures")
    k = int(np.clip(np.searchsorted(t_s, at_s) - 1, 0, len(t_s) - 2))
    share = float(np.clip((at_s - t_s[k]) / (t_s[k + 1] - t_s[k]), 0, 1))
    a, b = poses[k], poses[k + 1]
    turn = cv2.Rodrigues(cv2.Rodrigues(b[:, :3] @ a[:, :3].T)[0] * share)[0] @ a[:, :3]
    return np.column_stack([turn, (1 - share) * a[:, 3] + share * b[:, 3]])


def world_pose(trial: TrueTrial, body: str, t_s: float) -> NDArray[np.float64]:
    """Return a body's true pose (3, 4) in the world's axes, which are the table's."""
    if body == "table":
        return np.eye(3, 4)
    return _interpolated(trial.t_s, trial.palm if body == "hand" else trial.object, t_s)


def _still(pose: NDArray[np.float64], _body: str, _t_s: float) -> NDArray[np.float64]:
    return pose


def board_pictures(
    film: Film, *, lens: Lens = LENS, n: int = 60, seed: int = 5
) -> Iterator[NDArray[np.uint8]]:
    """Return pictures of the ChArUco board, held by hand at many places and turns before the camera."""
    board, (width_mm, height_mm) = charuco_board(), board_size_mm()
    scale, rim = 4, 12  # texels a millimetre; white rim, millimetres
    print_ = board.generateImage(
        (round(scale * width_mm), round(scale * height_mm)), marginSize=0, borderBits=1
    )
    texture = np.pad((print_ > 127).astype(np.float32), scale * rim, constant_values=1.0)
    half = np.array([width_mm / 2 + rim, height_mm / 2 + rim]) / 1000
    corners = np.array(
        [[-half[0], half[1], 0], [half[0], half[1], 0], [half[0], -half[1], 0], [-half[0], -half[1], 0]]
    )
    camera, rng, cv2 = SceneCamera(lens, film, seed=seed), np.random.default_rng(seed), load_cv2("figures")
    background = np.full((lens.height, lens.width), _GREY_ROOM, np.float32)
    upright = np.diag([1.0, -1.0, -1.0])  # the board's upper side up, its front to the camera
    for number in range(n):
        column, row = number % 3, number // 3 % 3
        turn = cv2.Rodrigues(rng.uniform(-0.7, 0.7, 3) * (1, 1, 0.3))[0] @ upright
        deep = rng.uniform(0.4, 0.75)
        at = np.array([(column - 1) * 0.36 * deep, (row - 1) * 0.17 * deep, deep])
        face = Face(corners, texture, "board")
        still = np.column_stack([turn, at])
        yield camera.picture(background, [face], partial(_still, still), 0.0)


class RenderedTrial:
    """The pictures of a trial, from ``begin_s`` to ``end_s``.

    ``lens`` is the camera's true one, ``eye_m`` where it stands; ``seed`` is of the noise. ``layout`` is
    where the tags truly are; ``world_to_camera`` is float64 (3, 4).
    """

    def __init__(
        self,
        trial: TrueTrial,
        film: Film,
        *,
        rate_hz: float,
        begin_s: float,
        end_s: float,
        seed: int,
        lens: Lens = LENS,
        eye_m: tuple[float, float, float] = EYE_M,
    ) -> None:
        self._trial = trial
        self.layout = bench_layout(trial)
        self._camera = SceneCamera(lens, film, seed=seed + 1)
        self.world_to_camera = camera_pose(eye_m)
        self.t_s = np.arange(begin_s, end_s, 1 / rate_hz)
        self._lens = lens
        family = self.layout.family
        slide: dict[bool, list[tuple[PlacedTag, str]]] = {True: [], False: []}
        for name, body in self.layout.bodies().items():
            for tag in body.all_tags():
                slide[any(tag.slides)].append((tag, name))
        self._still = [tag_face(tag, family, name) for tag, name in slide[False] if name == "table"]
        self._faces = [tag_face(tag, family, name) for tag, name in slide[False] if name != "table"]
        self._sliding = [(tag_face(tag, family, name), np.array(tag.slides) / 2) for tag, name in slide[True]]
        self._background = self._room()

    def pose(self, body: str, t_s: float) -> NDArray[np.float64]:
        """Return a body's true pose (3, 4) in the camera's axes."""
        here = self.world_pose(body, t_s)
        turn, shift = self.world_to_camera[:, :3], self.world_to_camera[:, 3]
        return np.column_stack([turn @ here[:, :3], turn @ here[:, 3] + shift])

    def world_pose(self, body: str, t_s: float) -> NDArray[np.float64]:
        """Return a body's true pose (3, 4) in the world's axes, which are the table's."""
        return world_pose(self._trial, body, t_s)

    def pictures(self) -> Iterator[tuple[float, NDArray[np.uint8]]]:
        """Return times and pictures."""
        trial = self._trial
        narrowing = np.array([truth.deformation_m for truth in trial.truths])
        for t_s in self.t_s:
            narrow = float(np.interp(t_s, trial.t_s, narrowing))
            moved = [face._replace(corners=face.corners - narrow * route) for face, route in self._sliding]
            hulls = self._hulls(int(np.searchsorted(trial.t_s, t_s)))
            yield (
                float(t_s),
                self._camera.picture(
                    self._background, self._faces + moved, self.pose, float(t_s), hulls=hulls
                ),
            )

    def _room(self) -> NDArray[np.float32]:
        """Return table and wall, with the table's tags."""
        cv2 = load_cv2("figures")
        light = np.full((self._lens.height, self._lens.width), _GREY_ROOM, np.float32)
        side = np.array([[-0.6, -0.5, 0], [0.6, -0.5, 0], [0.6, 0.5, 0], [-0.6, 0.5, 0]])
        turn, shift = self.world_to_camera[:, :3], self.world_to_camera[:, 3]
        there = side @ turn.T + shift
        near = self._lens.pixels(there[there[:, 2] > 0.1])
        cv2.fillConvexPoly(
            light, cv2.convexHull(np.rint(near * 16).astype(np.int32)), _GREY_TABLE, cv2.LINE_8, 4
        )
        return self._camera.lit(light, self._still, self.pose, 0.0)

    def _hulls(self, snapshot: int) -> list[tuple[float, NDArray[np.float64], float]]:
        """Return silhouettes of hand, arm and object."""
        trial = self._trial
        turn, shift = self.world_to_camera[:, :3], self.world_to_camera[:, 3]
        hulls = []
        for shape, pose in zip(trial.shapes, trial.poses[min(snapshot, len(trial.poses) - 1)], strict=True):
            if shape.kind == "plane":
                continue
            size = np.array([*shape.size_m, 0, 0, 0])[:3]
            if shape.kind == "sphere":
                half = np.array([size[0]] * 3)
            elif shape.kind in {"capsule", "cylinder"}:
                half = np.array([size[0], size[0], size[1] + (size[0] if shape.kind == "capsule" else 0)])
            else:
                half = size
            angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
            ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(16)])
            if shape.kind == "box":
                points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
            else:
                points = np.concatenate([np.add(ring, (0, 0, end)) for end in (-1, 1)]) * half
            there = (points @ to_matrix(np.roll(pose[3:], -1)).T + pose[:3]) @ turn.T + shift
            if there[:, 2].min() < 0.2:
                continue
            grey = 40 + 110 * float(np.mean(shape.rgba[:3]))
            hulls.append((float(np.linalg.norm(there.mean(0))), self._lens.pixels(there), grey))
        return hulls
