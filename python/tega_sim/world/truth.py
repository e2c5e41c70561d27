"""Detect lift-off, slip, deformation, damage and drop from the true state of the simulated world."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from tega_sim.seams import WorldTruth
from tega_sim.world.body import LiftedBody
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.pads import PadContacts

_LIFTED_M: Final = 1e-3
_LOST_M: Final = 0.03
_FREE_S: Final = 0.05


class Witness:
    """Watches the object, which stands at rest at first, and returns its true state.

    * **Lift-off**: the lowest point of the object is 1 mm over the table. It ends when the object stands
      again.
    * **Slip**: how far the object has moved down against the palm since lift-off, negative if up; 0 before.
      It includes the give of the fingers under the load, which an observer sees as slip, too. Turning counts
      by the motion of the object's middle.
    * **Deformation** and **damage**: how much narrower the object is than untouched, and how much of that
      stays; see :mod:`tega_sim.world.body`.
    * **Drop**: after lift-off the object slid 30 mm, or was in the air with nothing touching it for 50 ms. It
      stays true.
    """

    def __init__(self, model: Any, data: Any, spec: ObjectSpec, touch: PadContacts, body: LiftedBody) -> None:
        self._data, self._spec, self._touch, self._body = data, spec, touch, body
        palm = model.site("palm").id
        # Views of MuJoCo's own memory: they follow the state.
        self._palm, self._palm_turned = data.site_xpos[palm], data.site_xmat[palm]
        self._rest_m = body.middle_m()[2]
        self._lifted = self._dropped = False
        self._reference_m = 0.0
        self._untouched_since: float | None = None

    def watch(self) -> None:
        """Take note of what only shows as it happens; call every few milliseconds."""
        height = self._body.lowest_m()
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

    def truth(self, t_s: float, palm_speed_m_s: Callable[[], float]) -> WorldTruth:
        """Return the true state now; the palm's speed is asked for only where it counts."""
        pads, _, _ = self._touch.read()
        lifted = self._lifted
        middle = self._body.middle_m()
        return WorldTruth(
            t_s=t_s,
            object_height_m=middle[2] - self._rest_m,
            lift_off=lifted,
            pad_force_n=(pads[0], pads[1], pads[2], pads[3]),
            slip_m=self._slip_m() if lifted else 0.0,
            slip_m_s=palm_speed_m_s() - self._body.rise_m_s() if lifted else 0.0,
            deformation_m=self._body.narrowing_m(),
            damage_m=self._body.damage_m(),
            dropped=self._dropped,
            hand_to_object_m=self._reach_m(middle),
        )

    def _reach_m(self, middle: tuple[float, float, float]) -> float:
        """Return the distance from the middle of the grasp to where the object is to be held."""
        spec = self._spec
        out, forward = spec.palm_to_axis_m
        palm, palm_turned, up = self._palm.tolist(), self._palm_turned.tolist(), self._body.upright()
        over = spec.grasp_height_m - spec.height_m / 2
        square: float = 0.0
        for axis in range(3):
            grasp = palm[axis] + palm_turned[3 * axis] * out + palm_turned[3 * axis + 2] * forward
            square += (grasp - middle[axis] - up[axis] * over) ** 2
        return math.sqrt(square)

    def _over_palm_m(self) -> float:
        return self._body.middle_m()[2] - float(self._palm[2])

    def _slip_m(self) -> float:
        return self._reference_m - self._over_palm_m()
