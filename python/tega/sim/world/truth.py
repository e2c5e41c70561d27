"""What is so in the world: lift-off, slip, deformation, damage, drop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.sim.seams import Truth
from tega.sim.world.allegro import FINGERS
from tega.sim.world.objects import ObjectSpec
from tega.sim.world.pads import Touch

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
        self._object = model.body("object").id
        self._palm = model.site("palm").id
        self._dof = model.joint("object").dofadr[0]
        self._shells = [
            [model.joint(f"{finger}_shell_{axis}").qposadr[0] for axis in "xy"] for finger in FINGERS
        ]
        self._plastic: list[list[int]] = []
        if spec.plastic_share > 0:
            self._plastic = [
                [model.tendon_plasticadr[model.tendon(f"{finger}_set_{axis}").id] for axis in "xy"]
                for finger in FINGERS
            ]
        self._rest_m = float(data.xpos[self._object][2])
        self._started = data.time
        self._lifted = self._ever_lifted = self._dropped = False
        self._reference_m = 0.0
        self._untouched_since: float | None = None

    def watch(self) -> None:
        """Take note of what only shows as it happens; call every few milliseconds."""
        height = self._lowest_m()
        if not self._lifted and height > _LIFTED_M:
            self._lifted = self._ever_lifted = True
            self._reference_m = self._over_palm_m()
        elif self._lifted and height < _LIFTED_M / 2:
            self._lifted = False
        if not self._lifted or self._dropped:
            return
        if self._slip_m() > _LOST_M:
            self._dropped = True
        pads, rest, _ = self._touch.read() if self._data.ncon else (np.zeros(4), 0.0, 0.0)
        if pads.any() or rest > 0:
            self._untouched_since = None
        elif self._untouched_since is None:
            self._untouched_since = self._data.time
        elif self._data.time - self._untouched_since >= _FREE_S:
            self._dropped = True

    def truth(self, t_s: float, palm_speed_m_s: float) -> Truth:
        """Return what is so now."""
        data = self._data
        pads, _, _ = self._touch.read()
        spec = self._spec
        out, forward = spec.palm_to_axis_m
        grasp = data.site_xpos[self._palm] + data.site_xmat[self._palm].reshape(3, 3) @ np.array(
            [out, 0.0, forward]
        )
        turned = data.xmat[self._object].reshape(3, 3)
        held = data.xpos[self._object] + turned @ np.array([0, 0, spec.grasp_height_m - spec.height_m / 2])
        away = grasp - held
        dents = np.array([[data.qpos[x], data.qpos[y]] for x, y in self._shells])
        lifted = self._lifted
        return Truth(
            t_s=t_s,
            object_height_m=float(data.xpos[self._object][2]) - self._rest_m,
            lift_off=lifted,
            pad_force_n=(float(pads[0]), float(pads[1]), float(pads[2]), float(pads[3])),
            slip_m=self._slip_m() if lifted else 0.0,
            slip_m_s=palm_speed_m_s - float(data.qvel[self._dof + 2]) if lifted else 0.0,
            deformation_m=_narrowing(dents),
            damage_m=_narrowing(self._set_m()),
            dropped=self._dropped,
            hand_to_object_m=float(np.sqrt(away @ away)),
        )

    def _lowest_m(self) -> float:
        up = float(self._data.xmat[self._object][8])
        spec = self._spec
        middle = float(self._data.xpos[self._object][2])
        return middle - spec.height_m / 2 * abs(up) - spec.diameter_m / 2 * max(0.0, 1 - up * up) ** 0.5

    def _over_palm_m(self) -> float:
        return float(self._data.xpos[self._object][2] - self._data.site_xpos[self._palm][2])

    def _slip_m(self) -> float:
        return self._reference_m - self._over_palm_m()

    def _set_m(self) -> NDArray[np.float64]:
        share = self._spec.plastic_share
        if not self._plastic:
            return np.zeros((4, 2))
        return share * np.array([[self._data.plastic[x], self._data.plastic[y]] for x, y in self._plastic])


def _narrowing(dents: NDArray[np.float64]) -> float:
    """Return the largest narrowing of four dents in the horizontal plane, float64 (4, 2), metres."""
    size = np.sqrt((dents * dents).sum(axis=1))
    largest = 0.0
    for dent, own in zip(dents, size, strict=True):
        if own > 1e-9:
            opposite = -float((dents @ (dent / own)).min())
            largest = max(largest, float(own) + max(0.0, opposite))
    return largest
