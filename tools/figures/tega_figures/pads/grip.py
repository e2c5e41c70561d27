"""Grip an object at one closure level, lift it, and measure where it meets the pads at the end of the hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.hand import HandController
from tega.hand.mjcf import FULL_DUTY_NM
from tega.haptics import FINGERS
from tega_sim.gel import Gel
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.world import World

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Held", "grip"]

_TICK_S: Final = 3e-3
_EVERY: Final = 25
# Until when the hand does what: level (0: the one asked for) and height over the table.
_PLAN: Final = ((1.6, 1, 0.0), (3.8, 0, 0.0), (5.1, 0, 0.15), (5.7, 0, 0.15))
_LATE_S: Final = 0.3


class Held(NamedTuple):
    """The end of a hold, means over its last 0.3 s.

    Attributes:
        held: Whether the object was up and not dropped.
        slip_mm: How far it slid down against the palm since lift-off.
        forces_n: Normal force on each pad, float64 (4,), thumb first.
        along_mm: Place of the contact along each pad, from its middle towards the palm, float64 (4,).
        share: Share of each contact's area inside its camera's picture, float64 (4,); NaN without a contact,
            or where it was not to be computed.
        torques: Largest torque of each joint, float64 (16,), torque units.
    """

    held: bool
    slip_mm: float
    forces_n: NDArray[np.float64]
    along_mm: NDArray[np.float64]
    share: NDArray[np.float64]
    torques: NDArray[np.float64]


def grip(
    spec: ObjectSpec | str, level: int, poses_rad: NDArray[np.float64], *, seed: int = 0, shares: bool = False
) -> Held:
    """Close the hand around an object to a level, 2 to 5, lift it 0.15 m and hold it.

    ``poses_rad`` are the joint angles of the five levels, (5, 16); ``seed`` is of the object's place. With
    ``shares``, the gels are pressed for the shares inside the picture.
    """
    world, controller = World(spec, seed=seed, start_m=(0.0, 0.0)), HandController(poses_rad=poses_rad)
    gels = [Gel(0, spread=0) for _ in FINGERS] if shares else []
    found, inside, torques = [], [], np.zeros(16)
    tick = 0
    for until_s, wanted, height_m in _PLAN:
        world.set_forearm((height_m, 0.0))
        while tick * _TICK_S < until_s - 1e-9:
            asked = controller.step(world.angles_rad, wanted or level)
            tick += 1
            world.set_torques(FULL_DUTY_NM * asked)
            world.advance_to(tick * _TICK_S)
            if tick * _TICK_S > _PLAN[-1][0] - _LATE_S and tick % _EVERY == 0:
                found.append(_contacts(world))
                torques = np.maximum(torques, np.abs(asked))
                inside.append(_shares(world, gels))
    truth = world.truth()
    forces_n, along_mm = np.mean(found, axis=0)
    return Held(
        held=truth.lift_off and not truth.dropped,
        slip_mm=1e3 * truth.slip_m,
        forces_n=forces_n,
        along_mm=along_mm,
        share=np.mean(inside, axis=0),
        torques=torques,
    )


def _contacts(world: World) -> NDArray[np.float64]:
    """Return force and place along of each pad's contact, float64 (2, 4); 0 without one."""
    model, data, force = world.model, world.data, np.zeros(6)
    pads = {model.geom(f"{finger}_pad").id: k for k, finger in enumerate(FINGERS)}
    sums = np.zeros((2, 4))
    for number, pair in enumerate(data.contact.geom.tolist()):
        for k in {pads[shape] for shape in pair if shape in pads}:
            world.mujoco.mj_contactForce(model, data, number, force)
            pad = data.site(f"{FINGERS[k]}_pad")
            _, _, tip = pad.xmat.reshape(3, 3).T @ (data.contact.pos[number] - pad.xpos)
            sums[:, k] += force[0] * np.array([1.0, -1e3 * tip])
    sums[1:] /= np.maximum(sums[0], 1e-9)
    return sums


def _shares(world: World, gels: list[Gel]) -> list[float]:
    """Return the share of each contact's area in the picture; nothing in it at all is 0."""
    if not gels:
        return [np.nan] * len(FINGERS)
    shares = []
    for gel, pressing in zip(gels, world.pads(), strict=True):
        gel.press(pressing)
        shares.append(float(np.nan_to_num(gel.in_view)) if pressing else np.nan)
    return shares
