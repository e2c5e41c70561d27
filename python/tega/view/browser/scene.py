"""Draw the 3-D scene: primitives as three batches, forces as arrows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, get_args

import numpy as np

from tega.errors import InvalidValueError, ShapeError
from tega.view.browser.looks import LOOKS
from tega.view.state import ShapeKind

if TYPE_CHECKING:
    import viser
    from numpy.typing import NDArray

    from tega.view.state import Shape

__all__ = ["Point", "Scene"]

# Length of a force's arrow, metres a newton, and the longest that is drawn.
_M_PER_N, _LONGEST_M = 0.02, 0.15
_FIELD_OF_VIEW_RAD = 0.7
_FORCE_RED = (214, 40, 40)
# A plane is drawn as a board under it, so thick.
_PLANE_M = 0.01


Point: TypeAlias = tuple[float, float, float]


class _ShapePart(NamedTuple):
    """One instance of a unit primitive, fixed to a shape."""

    shape: int
    offset_m: float  # along the shape's own z
    scale: tuple[float, float, float]
    shade: float = 1.0


class Scene:
    """Draws shapes, poses and contact forces.

    All boxes, all balls and all tubes are one mesh each, drawn many times: a moment costs three messages however many
    shapes there are.

    Args:
        server: The viser server.
        eye_m: Where the camera of whoever opens the page begins, world frame.
        at_m: What it looks at.

    Attributes:
        batches: viser's handle of each mesh in use, and the parts that are drawn with it.
    """

    def __init__(self, server: viser.ViserServer, *, eye_m: Point, at_m: Point) -> None:
        self._server = server
        self._shapes: Sequence[Shape] | None = None
        self.batches: list[tuple[Any, list[_ShapePart]]] = []
        self._arrows: Any = None
        # Made before a run begins: the library that makes them takes its time to import.
        self._meshes = {name: _unit_mesh(name) for name in ("box", "ball", "tube")}
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
    ) -> None:
        """Draw one moment.

        Raises:
            ShapeError: There are not as many poses as shapes.
            InvalidValueError: A shape's kind is not known.
        """
        if shapes is None or poses is None:
            shapes, poses = (), np.empty((0, 7))
        if poses.shape != (len(shapes), 7):
            raise ShapeError(f"poses have shape {poses.shape}, expected ({len(shapes)}, 7)")
        if shapes is not self._shapes and not (self._shapes is not None and not shapes and not self._shapes):
            self._rebuild(shapes, poses)
        for handle, parts in self.batches:
            handle.batched_positions, handle.batched_wxyzs = _placed(parts, poses)
        self._forces(contact_points)

    def _rebuild(self, shapes: Sequence[Shape], poses: NDArray[np.float64]) -> None:
        for handle, _ in self.batches:
            handle.remove()
        self._shapes, self.batches = shapes, []
        if len(shapes):
            solids = ((shape, pose) for shape, pose in zip(shapes, poses, strict=True) if shape[1] != "plane")
            lowest_m = min((pose[2] - max(shape[2]) for shape, pose in solids), default=0.0)
            self._floor.position = (0.0, 0.0, min(0.0, lowest_m))
        for name, parts in _parts(shapes).items():
            if not parts:
                continue
            vertices, faces = self._meshes[name]
            rgba = np.array([shapes[part.shape][3] for part in parts])
            rgba[:, :3] = np.minimum(rgba[:, :3] * [[part.shade] for part in parts], 1.0)
            positions, wxyzs = _placed(parts, poses)
            handle = self._server.scene.add_batched_meshes_simple(
                f"/world/{name}",
                vertices,
                faces,
                wxyzs,
                positions,
                batched_scales=np.array([part.scale for part in parts], np.float32),
                batched_colors=np.rint(rgba[:, :3] * 255).astype(np.uint8),
                batched_opacities=None if np.all(rgba[:, 3] >= 1) else rgba[:, 3].astype(np.float32),
                lod="off",
                flat_shading=name == "box",
                cast_shadow=True,
                receive_shadow=True,
            )
            self.batches.append((handle, parts))

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


def _parts(shapes: Sequence[Shape]) -> dict[str, list[_ShapePart]]:
    """Say which unit primitives make up the shapes; a capsule is a tube with a ball at either end.

    A cylinder of the name of one of :data:`~tega.view.browser.looks.LOOKS` is drawn as that.
    """
    parts: dict[str, list[_ShapePart]] = {"box": [], "ball": [], "tube": []}
    for number, (name, kind, (a, b, c), _) in enumerate(shapes):
        if kind == "cylinder" and name in LOOKS:
            for look in LOOKS[name]:
                scale = (look.wide * a, look.wide * a, look.tall * b)
                parts[look.primitive].append(_ShapePart(number, look.middle * b, scale, look.shade))
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
