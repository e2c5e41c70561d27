"""Build the lifted object as an MJCF fragment: a rigid core with a springy shell for each finger, or one elastic solid.

Each shell is the whole outer surface, seen by one finger only, on two springs across the horizontal plane: so each
finger dents the wall where it is, without denting it for the others. The palm and the table meet the core.

The solid is a MuJoCo flex on a grid of 2 x 2 x 2 cells. The surface that touches is a fine round mesh; what moves are
the 27 corners of the cells, so that the object bulges between the fingers and sags under its weight at the cost of 81
degrees of freedom.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from tega.errors import InvalidValueError
from tega.wire import HAND_FINGERS
from tega_sim.world.objects import ObjectSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Light bodies make soft contacts, as their stiffness scales with mass; so shells are given a fair share of it.
_SHELL_SHARE: Final = 0.08
_REACH_M: Final = 0.9


def shell_mass_kg(spec: ObjectSpec) -> float:
    """Return the mass of one shell, kg; the core has the rest."""
    return _SHELL_SHARE * spec.mass_kg


def wall_rad_s(spec: ObjectSpec) -> float:
    """Return how fast the wall under one fingertip oscillates on its springs, rad/s."""
    return math.sqrt(spec.stiffness_n_m / shell_mass_kg(spec))


def object_body(spec: ObjectSpec) -> str:
    """Return the object's bodies, standing on the table at the origin."""
    radius, half = spec.diameter_m / 2, spec.height_m / 2
    mass = shell_mass_kg(spec)
    elastic = spec.stiffness_n_m * (1 - spec.plastic_share)
    damping = 2 * spec.damping_ratio * (spec.stiffness_n_m * mass) ** 0.5
    reach = _REACH_M * radius
    colour = " ".join(map(str, spec.rgba))
    straight = half - radius
    shells = "".join(
        f'<body name="{finger}_shell">'
        + "".join(
            f'<joint name="{finger}_shell_{axis}" type="slide" axis="{along}" limited="true" range="{-reach} {reach}" '
            f'stiffness="{elastic} 0 {spec.stiffening_n_m3}" damping="{damping}"/>'
            for axis, along in (("x", "1 0 0"), ("y", "0 1 0"))
        )
        + f'<geom name="{finger}_shell" class="shell{number}" type="capsule" size="{radius} {straight}" '
        f'mass="{mass}" friction="{spec.friction} 0.0012 0.0001"/></body>'
        for number, finger in enumerate(HAND_FINGERS)
    )
    return (
        f'<body name="object" pos="0 0 {half}"><freejoint name="object"/>'
        f'<geom name="core" class="core" type="capsule" size="{radius} {straight}" mass="0" '
        f'friction="{spec.friction} 0.0012 0.0001"/>'
        f'<geom name="object" class="base" type="cylinder" size="{radius} {half}" mass="{spec.mass_kg - 4 * mass}" '
        f'friction="{spec.friction} 0.005 0.0001" rgba="{colour}"/>'
        f"{shells}</body>"
    )


def object_tendons(spec: ObjectSpec) -> str:
    """Return the plastic springs beside the elastic ones; nothing where no share is plastic."""
    if spec.plastic_share == 0:
        return ""
    plastic = spec.stiffness_n_m * spec.plastic_share
    return "".join(
        f'<fixed name="{finger}_set_{axis}" stiffness="{plastic}" springyield="{spec.yield_m}">'
        f'<joint joint="{finger}_shell_{axis}" coef="1"/></fixed>'
        for finger in HAND_FINGERS
        for axis in "xy"
    )


NAME: Final = "object"
AROUND: Final = 16
"""Corners of the mesh around the object; an even number, so that each has one opposite."""

UP: Final = 2
"""Layers of the mesh from bottom to top: one a cell, as a wall stays straight within one."""

SKIN_M: Final = 5e-4
"""How far the surface that touches stands out from the mesh."""

# Young's modulus is the stiffness under a fingertip over this length: so a bag of 120 N/m
# gripped at levels 3 to 5 is about as narrow as one of springs.
_STIFFNESS_LENGTH_M: Final = 0.03
# Weight over base area as a share of Young's modulus: one that stands under 0.2 of it folds when it is gripped.
_CRUSHED: Final = 0.18


def mesh(spec: ObjectSpec) -> tuple[NDArray[np.float64], list[tuple[int, ...]]]:
    """Return the points of the standing object, float64 (51, 3), metres, and its tetrahedra.

    Points lie in rings from below, in each the one on the axis first and then those around it. All tetrahedra meet in
    the middle of the object: few of them touch a finger at a time, and each contact costs.
    """
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.append(0.0, np.cos(angles)), np.append(0.0, np.sin(angles))], axis=1)
    points = np.array(
        [
            [*(spec.diameter_m / 2 * place), spec.height_m * layer / UP]
            for layer in range(UP + 1)
            for place in ring
        ]
    )
    solids: list[tuple[int, ...]] = []
    centre = UP // 2 * (AROUND + 1)
    for corner in range(AROUND):
        one, other = corner + 1, (corner + 1) % AROUND + 1
        top = UP * (AROUND + 1)
        solids += [(centre, 0, other, one), (centre, top, top + one, top + other)]
        for low in range(0, top, AROUND + 1):
            high = low + AROUND + 1
            solids += [
                (centre, low + one, low + other, high + other),
                (centre, low + one, high + other, high + one),
            ]
    return points, solids


def young_pa(spec: ObjectSpec) -> float:
    """Return Young's modulus; a solid that its own weight would crush raises :class:`InvalidValueError`."""
    young = spec.stiffness_n_m / _STIFFNESS_LENGTH_M
    pressure = spec.mass_kg * 9.81 / (np.pi / 4 * spec.diameter_m**2)
    if pressure > _CRUSHED * young:
        least = pressure / _CRUSHED * _STIFFNESS_LENGTH_M
        raise InvalidValueError(
            f"object {spec.name!r}: a flex of {spec.stiffness_n_m:g} N/m cannot carry its own {spec.mass_kg:g} kg",
            f"stiffness_n_m {math.ceil(least)} or more, or shell = 'pads'",
        )
    return young


def flex_body(spec: ObjectSpec, contact: str) -> str:
    """Return the object, standing on the table at the origin, with the contact's attributes given."""
    points, solids = mesh(spec)
    # As much of the stiffness as in the wall on springs.
    damping_s = 2 * spec.damping_ratio * (shell_mass_kg(spec) / spec.stiffness_n_m) ** 0.5
    places = " ".join(f"{value:.9g}" for value in points.ravel())
    corners = " ".join(str(point) for solid in solids for point in solid)
    return (
        f'<flexcomp name="{NAME}" type="direct" dim="3" dof="trilinear" cellcount="2 2 2" mass="{spec.mass_kg}" '
        f'radius="{SKIN_M}" pos="0 0 {SKIN_M}" point="{places}" element="{corners}">'
        f'<contact selfcollide="none" contype="0" conaffinity="63" priority="1" {contact} '
        f'friction="{spec.friction} 0.0012 0.0001"/>'
        f'<elasticity young="{young_pa(spec)}" damping="{damping_s}"/></flexcomp>'
    )
