"""Build the whole scene as one MuJoCo model, and set how its physics is solved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import msgspec
import numpy as np

from tega.errors import InvalidValueError, MissingExtraError
from tega.hand.mjcf import hand_actuators, hand_body
from tega_sim.world.flex import flex_body, object_body, object_tendons, wall_rad_s
from tega_sim.world.follower import arm_actuators, arm_body
from tega_sim.world.objects import ObjectSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray


PALM_ROTATION: Final = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Palm to world: the fingers point along x, the palm faces y, the index finger is on top. float64 (3, 3)."""

_TURN_RAD: Final = 1.0


class Physics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of the physics solver; defaults chosen by run time against error (docs/evidence/sim.md).

    Attributes:
        timestep_s: One step; that of the hand's cycle.
        impratio: How much harder friction is than the normal force; more creeps less.
        noslip: Sweeps that take the remaining creep away.
        solref_s: Time constant of a contact, at least two steps.
        onset: How hard a contact is at first touch, of 0.99 at ``width_m``; with a hard one sliding pads
            chatter.
        width_m: Depth at which a contact is as hard as it gets.
        tolerance: Where the solver stops. A looser one takes longer: the next step starts further off.
    """

    timestep_s: Annotated[float, msgspec.Meta(ge=1e-4, le=3e-3)] = 3e-3
    impratio: Annotated[float, msgspec.Meta(ge=1, le=10_000)] = 1000.0
    noslip: Annotated[int, msgspec.Meta(ge=0, le=20)] = 0
    solref_s: Annotated[float, msgspec.Meta(ge=2e-3, le=0.1)] = 0.01
    onset: Annotated[float, msgspec.Meta(ge=0.1, le=0.98)] = 0.3
    width_m: Annotated[float, msgspec.Meta(ge=1e-4, le=0.01)] = 0.002
    tolerance: Annotated[float, msgspec.Meta(ge=1e-12, le=1e-3)] = 1e-11
    integrator: Literal["implicitfast", "implicit", "discrete"] = "implicitfast"


def physics_for(spec: ObjectSpec, physics: Physics | None) -> Physics:
    """Return the requested physics, or the default for an object.

    The default step is halved for a stiff wall on a light object, until the wall's own oscillation turns by
    at most 1 rad in it: forces of a grip are then within a hundredth or two of those with the finest steps. A
    flex that is to be moved in a way that MuJoCo cannot move it raises :class:`InvalidValueError`.
    """
    if spec.shell != "flex":
        return physics or _steady(spec)
    found = physics or Physics(integrator="discrete")
    if found.integrator != "discrete" or found.noslip:
        raise InvalidValueError(
            f"object {spec.name!r} is a flex, which cannot go with integrator {found.integrator!r} and "
            f"{found.noslip} sweeps of noslip",
            "integrator = 'discrete' and noslip = 0",
        )
    return found


def _steady(spec: ObjectSpec) -> Physics:
    found = Physics()
    while wall_rad_s(spec) * found.timestep_s > _TURN_RAD:
        found = msgspec.structs.replace(found, timestep_s=found.timestep_s / 2)
    return found


def import_mujoco() -> Any:
    """Import MuJoCo; a version that computes the grip wrongly counts as missing."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingExtraError("the simulated world needs mujoco-core", "pip install 'tega[sim]'") from error
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


def build(mujoco: Any, spec: ObjectSpec, physics: Physics) -> Any:
    """Return the model: table, arm, hand, object."""
    thing, tendons = object_parts(spec, physics)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco model="tega">{preamble(physics)}<worldbody>'
        '<geom name="table" class="table" type="plane" size="0.4 0.4 0.02"/>'
        f"{arm_body(hand_body())}{thing}"
        f"</worldbody><tendon>{tendons}</tendon>"
        f"<actuator>{arm_actuators()}{hand_actuators()}</actuator></mujoco>"
    )


def object_parts(spec: ObjectSpec, physics: Physics) -> tuple[str, str]:
    """Return the object's bodies and its tendons."""
    if spec.shell == "flex":
        return flex_body(spec, _contact(physics)), ""
    return object_body(spec), object_tendons(spec)


def preamble(physics: Physics) -> str:
    """Return the solver settings and the classes of shapes: contact pairs, and contact stiffness."""
    contact = _contact(physics)
    hand, unseen = 'rgba="0.27 0.2 0.5 1"', 'rgba="0 0 0 0"'
    classes = {f"finger{n}": f'contype="{1 << n}" conaffinity="0" {contact} {hand}' for n in range(4)}
    classes |= {
        f"shell{n}": f'contype="0" conaffinity="{1 << n}" priority="1" {contact} {unseen}' for n in range(4)
    }
    classes |= {
        "still": f'contype="0" conaffinity="0" {hand}',
        "palm": f'contype="16" conaffinity="0" {contact} {hand}',
        "core": f'contype="0" conaffinity="16" priority="1" {contact} {unseen}',
        "base": f'contype="0" conaffinity="32" priority="1" {contact}',
        "table": f'contype="32" conaffinity="0" {contact} rgba="0.88 0.84 0.78 1"',
    }
    defaults = "".join(f'<default class="{name}"><geom {text}/></default>' for name, text in classes.items())
    # The sparse solver is half as dear here as the dense one, which the size of the model would choose.
    return (
        '<compiler angle="radian"/>'
        f'<option timestep="{physics.timestep_s}" jacobian="sparse" integrator="{physics.integrator}" '
        f'cone="elliptic" impratio="{physics.impratio}" noslip_iterations="{physics.noslip}" '
        f'tolerance="{physics.tolerance}"><flag autoreset="disable"/></option><default>{defaults}</default>'
    )


def _contact(physics: Physics) -> str:
    return f'condim="4" solref="{physics.solref_s} 1" solimp="{physics.onset} 0.99 {physics.width_m} 0.5 2"'
