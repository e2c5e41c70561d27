"""Draw the 3-D scene: solids in batches, the hand as commanded, translucent, beside them, forces as arrows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
import viser
from numpy.typing import NDArray

from tega.errors import InvalidValueError, ShapeError
from tega.ui.view.browser.hand_figure import HandFigure
from tega.ui.view.figures import GHOST_COLOUR
from tega.ui.view.state import Shape, ShapeKind


class LookPart(NamedTuple):
    """A primitive of a look; a unit ``box``, ``ball`` or ``tube`` has half length 1 in each direction.

    ``middle`` is its position along the object's own z and ``tall`` its half height, as shares of the
    object's half height; ``wide`` is its half width, as a share of the object's radius; ``shade`` is a factor
    for its colour.
    """

    primitive: Literal["box", "ball", "tube"]
    middle: float
    wide: float
    tall: float
    shade: float = 1.0


LOOKS: Final[dict[str, tuple[LookPart, ...]]] = {
    "bottle": (
        LookPart("tube", -0.31, 1.0, 0.69),
        LookPart("ball", 0.38, 1.0, 0.3),
        LookPart("tube", 0.74, 0.34, 0.2),
        LookPart("tube", 0.91, 0.42, 0.09, 0.45),
        LookPart("tube", -0.62, 1.01, 0.16, 1.2),
    ),
    "container": (LookPart("box", -0.08, 0.86, 0.92), LookPart("box", 0.91, 0.93, 0.09, 0.8)),
    "bag": (
        LookPart("ball", -0.3, 1.06, 0.7),
        LookPart("ball", 0.05, 0.97, 0.75),
        LookPart("tube", 0.8, 0.26, 0.06, 0.45),
        LookPart("ball", 0.9, 0.5, 0.1),
    ),
}
"""By the name of a cylinder in the scene."""


# A plane is drawn as a board under it, so thick.
_PLANE_M = 0.01


class _ShapePart(NamedTuple):
    shape: int
    offset_m: float  # along the shape's own z
    scale: tuple[float, float, float]
    shade: float = 1.0


class Solids:
    """Draws shapes where they are.

    All boxes, all balls and all tubes are one mesh each, drawn many times: a moment costs three messages
    however many shapes there are. The meshes' names begin with ``path``; ``batches`` has viser's handle of
    each mesh in use, and the parts that are drawn with it.
    """

    def __init__(self, server: viser.ViserServer, path: str, *, shadow: bool = True) -> None:
        self._server, self._path, self._shadow = server, path, shadow
        self._shapes: Sequence[Shape] = ()
        self.batches: list[tuple[Any, list[_ShapePart]]] = []
        # Made before a run begins: the library that makes them takes its time to import.
        self._meshes = {name: _unit_mesh(name) for name in ("box", "ball", "tube")}

    def draw(self, shapes: Sequence[Shape], poses: NDArray[np.float64]) -> bool:
        """Draw the shapes at poses, float64 (n, 7); return whether the shapes have changed."""
        renewed = shapes is not self._shapes and bool(shapes or self._shapes)
        if renewed:
            self._rebuild(shapes, poses)
        for handle, parts in self.batches:
            handle.batched_positions, handle.batched_wxyzs = _placed(parts, poses)
        return renewed

    def _rebuild(self, shapes: Sequence[Shape], poses: NDArray[np.float64]) -> None:
        for handle, _ in self.batches:
            handle.remove()
        self._shapes, self.batches = shapes, []
        for name, parts in _parts(shapes).items():
            if not parts:
                continue
            vertices, faces = self._meshes[name]
            rgba = np.array([shapes[part.shape][3] for part in parts])
            rgba[:, :3] = np.minimum(rgba[:, :3] * [[part.shade] for part in parts], 1.0)
            positions, wxyzs = _placed(parts, poses)
            handle = self._server.scene.add_batched_meshes_simple(
                f"/{self._path}/{name}",
                vertices,
                faces,
                wxyzs,
                positions,
                batched_scales=np.array([part.scale for part in parts], np.float32),
                batched_colors=np.rint(rgba[:, :3] * 255).astype(np.uint8),
                batched_opacities=None if np.all(rgba[:, 3] >= 1) else rgba[:, 3].astype(np.float32),
                lod="off",
                flat_shading=name == "box",
                cast_shadow=self._shadow,
                receive_shadow=self._shadow,
            )
            self.batches.append((handle, parts))


def _parts(shapes: Sequence[Shape]) -> dict[str, list[_ShapePart]]:
    """Say which unit primitives make up the shapes; a capsule is a tube with a ball at either end."""
    parts: dict[str, list[_ShapePart]] = {"box": [], "ball": [], "tube": []}
    for number, (name, kind, (a, b, c), _) in enumerate(shapes):
        if kind == "cylinder" and name in LOOKS:
            for check in LOOKS[name]:
                scale = (check.wide * a, check.wide * a, check.tall * b)
                parts[check.primitive].append(_ShapePart(number, check.middle * b, scale, check.shade))
        elif kind == "box":
            parts["box"].append(_ShapePart(number, 0.0, (a, b, c)))
        elif kind == "sphere":
            parts["ball"].append(_ShapePart(number, 0.0, (a, a, a)))
        elif kind == "plane":
            parts["box"].append(_ShapePart(number, -_PLANE_M, (a, b, _PLANE_M)))
        elif kind in {"cylinder", "capsule"}:
            parts["tube"].append(_ShapePart(number, 0.0, (a, a, b)))
            if kind == "capsule":
                parts["ball"] += [_ShapePart(number, end, (a, a, a)) for end in (-b, b)]
        else:
            raise InvalidValueError(
                f"shape {name!r} is a {kind!r}: expected one of {', '.join(get_args(ShapeKind))}"
            )
    return parts


def _placed(
    parts: Sequence[_ShapePart], poses: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return position (n, 3) and quaternion (n, 4) of every part."""
    rows = poses[[part.shape for part in parts]]
    offsets = np.array([part.offset_m for part in parts])[:, None]
    w, x, y, z = rows[:, 3:].T
    own_z = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    return (rows[:, :3] + offsets * own_z).astype(np.float32), rows[:, 3:].astype(np.float32)


def _unit_mesh(name: str) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return vertices and faces of a primitive of half length 1 in every direction."""
    from trimesh import creation

    if name == "box":
        mesh = creation.box(extents=(2.0, 2.0, 2.0))
    elif name == "ball":
        mesh = creation.icosphere(subdivisions=3, radius=1.0)
    else:
        mesh = creation.cylinder(radius=1.0, height=2.0, sections=40)
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)


_OPACITY = 0.35
# Wider than the hand as measured by this much, so that two surfaces in one place do not flicker.
_WIDER_M = 0.0015


class GhostHand:
    """Draws the fingers of an Allegro hand at the joint angles that the hand steers to.

    If an object stops a finger, the commanded finger is drawn inside the object: the depth shows how firmly
    the hand is asked to press. The palm has no command and is left out. ``solids`` has no batches while
    nothing is commanded.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._figure = HandFigure()
        red, green, blue = (int(GHOST_COLOUR[k : k + 2], 16) / 255 for k in (1, 3, 5))
        self._places = [k for k, (name, *_) in enumerate(self._figure.shapes) if name != "palm"]
        self._shapes: list[Shape] = []
        for place in self._places:
            name, kind, (radius_m, half_m, more_m), _ = self._figure.shapes[place]
            size_m = (radius_m + _WIDER_M, half_m, more_m)
            self._shapes.append((name, kind, size_m, (red, green, blue, _OPACITY)))
        self.solids = Solids(server, "commanded", shadow=False)

    def draw(self, commanded: tuple[Sequence[float], NDArray[np.float64]] | None) -> None:
        """Draw 16 joint angles, rad, with the palm at a pose, float64 (7,); ``None`` draws nothing."""
        if commanded is None:
            self.solids.draw((), self._figure.poses([0.0] * 16)[:0])
        else:
            self.solids.draw(self._shapes, self._figure.poses(*commanded)[self._places])


# Length of a force's arrow, metres a newton, and the longest that is drawn.
_M_PER_N, _LONGEST_M = 0.02, 0.15
_FIELD_OF_VIEW_RAD = 0.7
_FORCE_RED = (214, 40, 40)

Point: TypeAlias = tuple[float, float, float]


class Scene:
    """Draws shapes, poses, contact forces and the hand as commanded."""

    def __init__(self, server: viser.ViserServer, *, eye_m: Point, at_m: Point) -> None:
        self._server = server
        self.solids, self.ghost = Solids(server, "world"), GhostHand(server)
        self._arrows: Any = None
        server.scene.set_up_direction("+z")
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = eye_m, at_m, _FIELD_OF_VIEW_RAD
        server.scene.configure_environment_map("apartment", environment_intensity=0.4)
        server.scene.configure_default_lights(cast_shadow=True)
        self._floor = server.scene.add_grid(
            "/floor", width=3, height=3, cell_size=0.1, section_size=0.5, cell_color=(225, 228, 232),
            section_color=(200, 205, 210), shadow_opacity=0.0,
        )  # fmt: skip

    def draw(
        self,
        shapes: Sequence[Shape] | None,
        poses: NDArray[np.float64] | None,
        contact_points: NDArray[np.float64] | None,
        commanded: tuple[Sequence[float], NDArray[np.float64]] | None = None,
    ) -> None:
        """Draw one moment: shapes, ``None`` for none, at as many poses, float64 (n, 7).

        ``contact_points`` are places and forces, float64 (k, 6). ``commanded`` are the joint angles that the
        hand steers to, 16, rad, and where its palm is, float64 (7,); ``None`` for no hand as commanded.
        """
        if shapes is None or poses is None:
            shapes, poses = (), np.empty((0, 7))
        if poses.shape != (len(shapes), 7):
            raise ShapeError(f"poses have shape {poses.shape}, expected ({len(shapes)}, 7)")
        if self.solids.draw(shapes, poses) and shapes:
            solids = ((shape, pose) for shape, pose in zip(shapes, poses, strict=True) if shape[1] != "plane")
            lowest_m = min((pose[2] - max(shape[2]) for shape, pose in solids), default=0.0)
            self._floor.position = (0.0, 0.0, min(0.0, lowest_m))
        self.ghost.draw(commanded)
        self._forces(contact_points)

    def _forces(self, contact_points: NDArray[np.float64] | None) -> None:
        lines = np.empty((0, 2, 3), np.float32)
        if contact_points is not None and len(contact_points):
            where, force = contact_points[:, :3], contact_points[:, 3:]
            size = np.linalg.norm(force, axis=1, keepdims=True)
            length = np.minimum(size * _M_PER_N, _LONGEST_M)
            # What the object does to the hand, the other way round: these arrows come out of the object and are seen.
            lines = np.stack([where, where - force / np.maximum(size, 1e-9) * length], axis=1)
            lines = lines[size[:, 0] > 0.02].astype(np.float32)
        if self._arrows is None:
            if not len(lines):
                return
            self._arrows = self._server.scene.add_arrows(
                "/forces", lines, _FORCE_RED, shaft_radius=0.0025, head_radius=0.006, head_length=0.014
            )
        if len(lines):
            self._arrows.points = lines
        self._arrows.visible = bool(len(lines))
