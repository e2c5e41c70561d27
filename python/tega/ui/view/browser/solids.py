"""Draw primitives on the page: all boxes, all balls and all tubes as one batch each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, get_args

import numpy as np

from tega.errors import InvalidValueError
from tega.ui.view.state import ShapeKind

if TYPE_CHECKING:
    import viser
    from numpy.typing import NDArray

    from tega.ui.view.state import Shape


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
    "container": (
        LookPart("box", -0.08, 0.86, 0.92),
        LookPart("box", 0.91, 0.93, 0.09, 0.8),
    ),
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
    """One instance of a unit primitive, fixed to a shape."""

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
        self._shapes: Sequence[Shape] | None = None
        self.batches: list[tuple[Any, list[_ShapePart]]] = []
        # Made before a run begins: the library that makes them takes its time to import.
        self._meshes = {name: _unit_mesh(name) for name in ("box", "ball", "tube")}

    def draw(self, shapes: Sequence[Shape], poses: NDArray[np.float64]) -> bool:
        """Draw the shapes at poses, float64 (n, 7); return whether the shapes have changed."""
        renewed = shapes is not self._shapes and not (
            self._shapes is not None and not shapes and not self._shapes
        )
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
    """Say which unit primitives make up the shapes; a capsule is a tube with a ball at either end.

    A cylinder of the name of one of :data:`~tega.ui.view.browser.solids.LOOKS` is drawn as that.
    """
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
