"""What is so in the world: lift-off, slip, deformation, damage, drop."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from tega.sim.seams import Truth
from tega.sim.world.allegro import FINGERS
from tega.sim.world.objects import ObjectSpec
from tega.sim.world.pads import Touch

__all__ = ["Witness"]

_LIFTED_M: Final = 1e-3
_LOST_M: Final = 0.03
_FREE_S: Final = 0.05


class Witness:
    """Watches the object and says what is true of it.

    * **Lift-off**: the lowest point of the object is 1 mm over the table. It ends when the object stands again.
    * **Slip**: how far the object has moved down against the palm since lift-off, negative if up; 0 before.
      It includes what the fingers give way under the load, which an observer sees as slip, too. Turning counts as
      far as the middle of the object moves.
    * **Deformation**: the largest narrowing, over the directions in which a finger dents the wall: its dent and
      what another dents from the opposite side.
    * **Damage**: the same of the dents that stay when nothing presses, by the plastic part of the wall's springs.
    * **Drop**: after lift-off the object slid 30 mm, or was in the air with nothing touching it for 50 ms. It
      stays true.

    Args:
        model: The world's model.
        data: Its state, with the object standing at rest.
        spec: The object.
        touch: Reader of contacts.
    """

    def __init__(self, model: Any, data: Any, spec: ObjectSpec, touch: Touch) -> None:
        self._data, self._spec, self._touch = data, spec, touch
        thing, palm = model.body("object").id, model.site("palm").id
        # Views of MuJoCo's own memory: they follow the state.
        self._at, self._turned = data.xpos[thing], data.xmat[thing]
        self._palm, self._palm_turned = data.site_xpos[palm], data.site_xmat[palm]
        self._speed = data.qvel[model.joint("object").dofadr[0] + 2 :]
        self._shells = np.array(
            [model.joint(f"{finger}_shell_{axis}").qposadr[0] for finger in FINGERS for axis in "xy"]
        )
        self._plastic = np.array(
            [
                model.tendon_plasticadr[model.tendon(f"{finger}_set_{axis}").id]
                for finger in (FINGERS if spec.plastic_share > 0 else ())
                for axis in "xy"
            ],
            np.intp,
        )
        self._rest_m = float(self._at[2])
        self._lifted = self._dropped = False
        self._reference_m = 0.0
        self._untouched_since: float | None = None

    def watch(self) -> None:
        """Take note of what only shows as it happens; call every few milliseconds."""
        height = self._lowest_m()
        if not self._lifted and height > _LIFTED_M:
            self._lifted = True
            self._reference_m = self._over_palm_m()
        elif self._lifted and height < _LIFTED_M / 2:
            self._lifted = False
        if not self._lifted or self._dropped:
            return
        if self._slip_m() > _LOST_M:
            self._dropped = True
        pads, rest, _ = self._touch.read()
        if rest > 0 or any(pads):
            self._untouched_since = None
        elif self._untouched_since is None:
            self._untouched_since = self._data.time
        elif self._data.time - self._untouched_since >= _FREE_S:
            self._dropped = True

    def truth(self, t_s: float, palm_speed_m_s: float) -> Truth:
        """Return what is so now."""
        pads, _, _ = self._touch.read()
        spec, lifted = self._spec, self._lifted
        x, y, z = self._at.tolist()
        return Truth(
            t_s=t_s,
            object_height_m=z - self._rest_m,
            lift_off=lifted,
            pad_force_n=(pads[0], pads[1], pads[2], pads[3]),
            slip_m=self._slip_m() if lifted else 0.0,
            slip_m_s=palm_speed_m_s - float(self._speed[0]) if lifted else 0.0,
            deformation_m=_narrowing(self._data.qpos[self._shells].tolist()),
            damage_m=self._damage_m(),
            dropped=self._dropped,
            hand_to_object_m=self._reach_m(spec, x, y, z),
        )

    def _reach_m(self, spec: ObjectSpec, x: float, y: float, z: float) -> float:
        """Return the distance from the middle of the grasp to where the object is to be held."""
        out, forward = spec.palm_to_axis_m
        palm, palm_turned, turned = self._palm.tolist(), self._palm_turned.tolist(), self._turned.tolist()
        over = spec.grasp_height_m - spec.height_m / 2
        square: float = 0.0
        for axis, middle in enumerate((x, y, z)):
            grasp = palm[axis] + palm_turned[3 * axis] * out + palm_turned[3 * axis + 2] * forward
            square += (grasp - middle - turned[3 * axis + 2] * over) ** 2
        return math.sqrt(square)

    def _lowest_m(self) -> float:
        up, spec = float(self._turned[8]), self._spec
        return (
            float(self._at[2])
            - spec.height_m / 2 * abs(up)
            - spec.diameter_m / 2 * math.sqrt(max(0.0, 1 - up * up))
        )

    def _over_palm_m(self) -> float:
        return float(self._at[2]) - float(self._palm[2])

    def _slip_m(self) -> float:
        return self._reference_m - self._over_palm_m()

    def _damage_m(self) -> float:
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
            opposite = -min(x * u + y * v for u, v in pairs) / own
            largest = max(largest, own + max(0.0, opposite))
    return largest
