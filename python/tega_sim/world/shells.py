"""Build the lifted object as an MJCF fragment: a rigid core and one springy shell for each finger.

Each shell is the whole outer surface, seen by one finger only, on two springs across the horizontal plane: so each
finger dents the wall where it is, without denting it for the others. The palm and the table meet the core.
"""

from __future__ import annotations

import math
from typing import Final

from tega.wire import HAND_FINGERS
from tega_sim.world.objects import ObjectSpec

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
