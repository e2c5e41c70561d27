"""Measure the lifted object: where it stands, how fast it rises, how narrow it is."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np

from tega.wire import HAND_FINGERS
from tega_sim.world.objects import ObjectSpec


class Shape(NamedTuple):
    """A primitive to draw.

    ``name`` is one of a kind. ``size_m``: half lengths; capsule, cylinder: radius, half length along z.
    """

    name: str
    kind: Literal["sphere", "capsule", "cylinder", "box", "plane"]
    size_m: tuple[float, float, float]
    rgba: tuple[float, float, float, float]


class LiftedBody:
    """A rigid core with a shell on springs for each finger; all measures are in the world frame.

    Narrowing is the largest over the directions in which a finger dents the wall: its dent and what another dents
    from the opposite side. Damage is the same of the dents that stay when nothing presses, by the plastic part of the
    wall's springs.
    """

    def __init__(self, model: Any, data: Any, spec: ObjectSpec) -> None:
        self._data, self._spec = data, spec
        thing, joint = model.body("object").id, model.joint("object")
        # Views of MuJoCo's own memory: they follow the state.
        self._at, self._turned = data.xpos[thing], data.xmat[thing]
        self._speed = data.qvel[joint.dofadr[0] + 2 :]
        self._push = data.xfrc_applied[thing]
        self._place = data.qpos[joint.qposadr[0] :]
        # The shells' slides lie one after the other: x and y of each finger.
        first = model.joint(f"{HAND_FINGERS[0]}_shell_x").qposadr[0]
        self._dents = data.qpos[first : first + 2 * len(HAND_FINGERS)]
        self._plastic = np.array(
            [
                model.tendon_plasticadr[model.tendon(f"{finger}_set_{axis}").id]
                for finger in (HAND_FINGERS if spec.plastic_share > 0 else ())
                for axis in "xy"
            ],
            np.intp,
        )

    def move(self, x_m: float, y_m: float) -> None:
        """Put the object elsewhere on the table."""
        self._place[:2] += (x_m, y_m)

    def push(self, force_n: float) -> None:
        """Push the object down from now on."""
        self._push[2] = -force_n

    def middle_m(self) -> tuple[float, float, float]:
        """Return where the object's middle is."""
        x, y, z = self._at.tolist()
        return x, y, z

    def upright(self) -> tuple[float, float, float]:
        """Return the object's axis, from bottom to top."""
        turned = self._turned.tolist()
        return turned[2], turned[5], turned[8]

    def rise_m_s(self) -> float:
        """Return how fast the object's middle goes up."""
        return float(self._speed[0])

    def lowest_m(self) -> float:
        """Return the height of the object's lowest point."""
        up, spec = float(self._turned[8]), self._spec
        return (
            float(self._at[2])
            - spec.height_m / 2 * abs(up)
            - spec.diameter_m / 2 * math.sqrt(max(0.0, 1 - up * up))
        )

    def narrowing_m(self) -> float:
        """Return how much narrower the object is than untouched."""
        return _narrowing(self._dents.tolist())

    def damage_m(self) -> float:
        """Return how much of the narrowing stays."""
        if not len(self._plastic):
            return 0.0
        return self._spec.plastic_share * _narrowing(self._data.plastic[self._plastic].tolist())


def _narrowing(dents: list[float]) -> float:
    """Return the largest narrowing, metres, of the fingers' dents: x and y of each, metres."""
    pairs = list(zip(dents[::2], dents[1::2], strict=True))
    largest = 0.0
    for x, y in pairs:
        own = math.hypot(x, y)
        if own > 1e-9:
            opposite = -min([x * u + y * v for u, v in pairs]) / own
            largest = max(largest, own + max(0.0, opposite))
    return largest
