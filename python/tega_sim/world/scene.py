"""Build the whole scene as one MuJoCo model, set how its physics is solved, and set the hand's closure poses.

The lifted object is a rigid core with a shell for each finger. Each shell is the whole outer surface, seen by one
finger only, on two springs across the horizontal plane: so each finger dents the wall where it is, without denting it
for the others. The palm and the table meet the core.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import MissingExtraError
from tega.hand import HandController
from tega.hand.mjcf import hand_actuators, hand_body
from tega.runtime.lifecycle import require
from tega.wire import HAND_FINGERS
from tega_sim.world.follower import arm_actuators, arm_body
from tega_sim.world.objects import ObjectSpec

PALM_ROTATION: Final = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Palm to world: the fingers point along x, the palm faces y, the index finger is on top. float64 (3, 3)."""

# Chosen by run time against error (docs/evidence/sim.md). Friction is this much harder than the normal force: more
# creeps less. A contact has this time constant, and so hard it is at first touch, of 0.99 at the width: with a hard
# one sliding pads chatter. A looser tolerance takes longer: the next step starts further off.
_STEP_S: Final = 3e-3
_SOLVER: Final = (
    'integrator="implicitfast" cone="elliptic" impratio="1000.0" noslip_iterations="0" tolerance="1e-11"'
)
_CONTACT: Final = 'condim="4" solref="0.01 1" solimp="0.3 0.99 0.002 0.5 2"'
_TURN_RAD: Final = 1.0
# Light bodies make soft contacts, as their stiffness scales with mass; so shells are given a fair share of it.
_SHELL_SHARE: Final = 0.08
_REACH_M: Final = 0.9


def _shell_mass_kg(spec: ObjectSpec) -> float:
    """Return the mass of one shell, kg; the core has the rest."""
    return _SHELL_SHARE * spec.mass_kg


def object_body(spec: ObjectSpec) -> str:
    """Return the object's bodies, standing on the table at the origin."""
    radius, half = spec.diameter_m / 2, spec.height_m / 2
    mass = _shell_mass_kg(spec)
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


def step_s(spec: ObjectSpec) -> float:
    """Return the step of the physics for an object, seconds.

    The hand's cycle, halved for a stiff wall on a light object until the wall's own oscillation turns by at most 1 rad
    in it: forces of a grip are then within a hundredth or two of those with the finest steps.
    """
    found, wall_rad_s = _STEP_S, math.sqrt(spec.stiffness_n_m / _shell_mass_kg(spec))
    while wall_rad_s * found > _TURN_RAD:
        found /= 2
    return found


def import_mujoco() -> Any:
    """Import MuJoCo; a version that computes the grip wrongly counts as missing."""
    mujoco = require("mujoco", driver="the simulated world", extra="sim")
    if mujoco.__version__ == "4.0.0":
        raise MissingExtraError(
            "MuJoCo 4.0.0 is installed; with it, gripped objects leap out of the hand",
            "pip install 'mujoco-core>=4.0.1'; franky-sim brings 4.0.0, and works with the other too",
        )
    return mujoco


def grasp_palm_m(spec: ObjectSpec) -> NDArray[np.float64]:
    """Return where the palm is in the grasp pose, world frame, with the object's axis at the origin."""
    out, forward = spec.palm_to_axis_m
    away: NDArray[np.float64] = PALM_ROTATION @ np.array([out, 0.0, forward])
    return np.array([0.0, 0.0, spec.grasp_height_m]) - away


def build(mujoco: Any, spec: ObjectSpec, timestep_s: float) -> Any:
    """Return the model: table, arm, hand, object."""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco model="tega">{preamble(timestep_s)}<worldbody>'
        '<geom name="table" class="table" type="plane" size="0.4 0.4 0.02"/>'
        f"{arm_body(hand_body())}{object_body(spec)}"
        f"</worldbody><tendon>{object_tendons(spec)}</tendon>"
        f"<actuator>{arm_actuators()}{hand_actuators()}</actuator></mujoco>"
    )


def preamble(timestep_s: float) -> str:
    """Return the solver settings and the classes of shapes: contact pairs, and contact stiffness."""
    hand, unseen = 'rgba="0.27 0.2 0.5 1"', 'rgba="0 0 0 0"'
    classes = {f"finger{n}": f'contype="{1 << n}" conaffinity="0" {_CONTACT} {hand}' for n in range(4)}
    classes |= {
        f"shell{n}": f'contype="0" conaffinity="{1 << n}" priority="1" {_CONTACT} {unseen}' for n in range(4)
    }
    classes |= {
        "still": f'contype="0" conaffinity="0" {hand}',
        "palm": f'contype="16" conaffinity="0" {_CONTACT} {hand}',
        "core": f'contype="0" conaffinity="16" priority="1" {_CONTACT} {unseen}',
        "base": f'contype="0" conaffinity="32" priority="1" {_CONTACT}',
        "table": f'contype="32" conaffinity="0" {_CONTACT} rgba="0.88 0.84 0.78 1"',
    }
    defaults = "".join(f'<default class="{name}"><geom {text}/></default>' for name, text in classes.items())
    # The sparse solver is half as dear here as the dense one, which the size of the model would choose.
    return (
        '<compiler angle="radian"/>'
        f'<option timestep="{timestep_s}" jacobian="sparse" {_SOLVER}><flag autoreset="disable"/></option>'
        f"<default>{defaults}</default>"
    )


# Levels 1 (open) to 5 (tight): a finger's joints, the thumb's. Open, but no wider than the objects ask for. From level
# 2 on pads meet the objects (`tega_figures.pads.design` of 219d27ec); levels 3 to 5 were made firmer by hand, as far as
# no joint has more than 0.219, 0.287 and 0.384 torque units, the largest with the poses of before.
_LEVELS_RAD: Final = (
    ((0.0, 0.500, 0.400, 0.300), (1.35, 0.200, -0.140, 0.400)),
    ((0.0, 1.045, 0.954, 0.477), (1.35, 0.033, 0.224, 0.981)),
    ((0.0, 1.165, 1.055, 0.490), (1.35, 0.050, 0.598, 1.100)),
    ((0.0, 1.190, 1.142, 0.470), (1.35, 0.097, 0.720, 1.120)),
    ((0.0, 1.315, 1.180, 0.460), (1.35, 0.230, 0.820, 1.170)),
)


GRASP_POSES_RAD: Final = np.array([(*finger, *finger, *finger, *thumb) for finger, thumb in _LEVELS_RAD])
GRASP_POSES_RAD.flags.writeable = False
"""Joint angles of levels 1 (open) to 5 (tight), float64 (5, 16); read-only."""


def hand_controller() -> HandController:
    """Return the real controller with the bench's poses; everything else is its default."""
    return HandController(poses_rad=GRASP_POSES_RAD)
