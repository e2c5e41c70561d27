"""Primitives as shaded polygons for matplotlib: MuJoCo's core has no renderer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.arm.rotation import to_matrix
from tega.ui.view.browser.scene import LOOKS, LookPart
from tega_sim.world.body import Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["add_solids"]

_AROUND: Final = 20
_CAP: Final = 5
_SLICES: Final = 8
_LIGHT: Final = np.array([-0.35, -0.55, 0.76])


def add_solids(axes: Any, shapes: list[Shape], poses: NDArray[np.float64], *, thing: str = "") -> None:
    """Draw primitives into axes of matplotlib's ``projection="3d"``.

    ``shapes`` and ``poses``, float64 (n, 7), are of :class:`~tega_sim.world.World`. ``thing`` is ``bottle``,
    ``container`` or ``bag``: draw the object as the page does, instead of the cylinder that fingers touch.
    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    polygons, colours = [], []
    for shape, pose in zip(shapes, poses, strict=True):
        looks = LOOKS.get(thing) if shape.name == "object" else None
        solids = (
            [(_faces(shape), 1.0)] if looks is None else [(_check(part, shape), part.shade) for part in looks]
        )
        for own, shade in solids:
            faces = own @ to_matrix(np.roll(pose[3:], -1)).T
            normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
            light = shade * (0.55 + 0.45 * np.clip(normals @ _LIGHT, -0.6, 1.0))
            polygons.append(faces + pose[:3])
            colours.append(np.clip(np.outer(light, shape.rgba[:3]), 0, 1))
    drawn = np.concatenate(colours)
    # Edges of the faces' own colours close the gaps that antialiasing leaves between them.
    axes.add_collection3d(
        Poly3DCollection(np.concatenate(polygons), facecolors=drawn, edgecolors=drawn, linewidths=0.4)
    )


def _check(part: LookPart, shape: Shape) -> NDArray[np.float64]:
    """Return the faces of a part of what an upright object looks like."""
    radius, half = part.wide * shape.size_m[0], part.tall * shape.size_m[1]
    match part.primitive:
        case "box":
            faces = _box(np.array([radius, radius, half]))
        case "tube":
            walls = [(radius, height) for height in np.linspace(-half, half, _SLICES)]
            faces = _turned([(0, -half), *walls, (0, half)])
        case "ball":
            angles = np.linspace(-np.pi / 2, np.pi / 2, 2 * _CAP + 1)
            faces = _turned([(radius * np.cos(a), half * np.sin(a)) for a in angles])
    moved: NDArray[np.float64] = faces + np.array([0.0, 0.0, part.middle * shape.size_m[1]])
    return moved


def _faces(shape: Shape) -> NDArray[np.float64]:
    """Return four-cornered faces, float64 (k, 4, 3), seen from outside anticlockwise."""
    match shape.kind:
        case "box":
            return _box(np.array(shape.size_m))
        case "plane":
            return _box(np.array([shape.size_m[0], shape.size_m[1], 1e-4]))
        case "cylinder":
            radius, half, _ = shape.size_m
            return _turned([(0, -half), (radius, -half), (radius, half), (0, half)])
        case "sphere" | "capsule":
            radius, half = shape.size_m[0], shape.size_m[1] if shape.kind == "capsule" else 0.0
            angles = np.linspace(-np.pi / 2, 0, _CAP)
            low = [(radius * np.cos(a), radius * np.sin(a) - half) for a in angles]
            return _turned([*low, *((r, -z) for r, z in reversed(low))])


def _turned(profile: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Return the faces of a profile (radius, height), from below upwards, turned about z."""
    around = np.linspace(0, 2 * np.pi, _AROUND + 1)
    rings = np.array([[(r * np.cos(a), r * np.sin(a), z) for a in around] for r, z in profile])
    corners = [rings[:-1, :-1], rings[:-1, 1:], rings[1:, 1:], rings[1:, :-1]]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def _box(half: NDArray[np.float64]) -> NDArray[np.float64]:
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], np.float64)
    upper = [np.roll(square, axis, axis=1) for axis in range(3)]
    return np.array([*upper, *(-face[::-1] for face in upper)]) * half
