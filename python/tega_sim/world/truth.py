"""Detect lift-off, slip, deformation, damage and drop from the true state, and read the contacts that it is made of.

The pad of the physics is rounded more than the gel of the picture (a capsule), so that a fingertip twists and rolls as
a soft one does. A contact beside the middle of the rounding therefore comes to the pad frame unrolled and rolled again
(``pad_pose`` of the crate ``tega-gel``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.hand.mjcf import PAD_HALF_LENGTH_M, PAD_RADIUS_M
from tega.haptics import FINGERS
from tega.wire import HAND_FINGERS
from tega_sim.seams import Indenter, WorldTruth
from tega_sim.world.body import LiftedBody
from tega_sim.world.objects import ObjectSpec


class PadContacts:
    """Reads a model's contacts: forces on pads, links and palm, and shapes before the pads."""

    def __init__(self, mujoco: Any, model: Any, data: Any) -> None:
        self._mujoco, self._model, self._data = mujoco, model, data
        self._pads = {model.geom(f"{finger}_pad").id: i for i, finger in enumerate(FINGERS)}
        # Places and rotations are views of MuJoCo's own memory: they follow the state.
        sites = [model.site(f"{finger}_pad").id for finger in FINGERS]
        self._pad_places = [(data.site_xpos[site], data.site_xmat[site]) for site in sites]
        self._table = model.geom("table").id
        shells = [model.geom(f"{finger}_shell").id for finger in HAND_FINGERS]
        self._object = {*shells, model.geom("core").id, model.geom("object").id}
        sizes = {shape: model.geom_size[shape].tolist() for shape in self._object}
        self._placed = {shape: (data.geom_xpos[shape], data.geom_xmat[shape]) for shape in self._object}
        self._size_mm = {shape: (1e3 * size[0], 1e3 * size[1], 0.0) for shape, size in sizes.items()}
        self._force = np.zeros(6)
        self._read_s, self._last = math.nan, ([0.0, 0.0, 0.0, 0.0], 0.0, 0.0)

    def read(self) -> tuple[list[float], float, float]:
        """Return normal forces, newtons: on each pad thumb first, on the rest of the hand, on the table."""
        now_s = self._data.time
        if now_s == self._read_s:  # the score asks, and what watches between steps, often of one state
            return self._last
        pads, rest, table = [0.0, 0.0, 0.0, 0.0], 0.0, 0.0
        for one, other, newtons in self._forces():
            pad = self._pads.get(one, self._pads.get(other))
            if pad is not None:
                pads[pad] += newtons
            elif self._table in (one, other):
                table += newtons
            else:
                rest += newtons
        self._read_s, self._last = now_s, (pads, rest, table)
        return self._last

    def indenters(self) -> list[list[Indenter]]:
        """Return the shapes that press each pad, thumb first; at most one a pad and primitive."""
        # Sums of force, and of force times place and normal: numbers one by one, as they are so few.
        found: list[dict[int, list[float]]] = [{} for _ in FINGERS]
        places = frames = None
        for number, (one, other, newtons) in enumerate(self._forces()):
            pad, shape, sign = self._pads.get(one), other, newtons
            if pad is None:
                pad, shape, sign = self._pads.get(other), one, -newtons
            if pad is None or newtons <= 0:
                continue
            if places is None or frames is None:
                places, frames = self._data.contact.pos.tolist(), self._data.contact.frame.tolist()
            (x, y, z), (u, v, w, *_) = places[number], frames[number]
            sums = [newtons, newtons * x, newtons * y, newtons * z, sign * u, sign * v, sign * w]
            before = found[pad].get(shape)
            found[pad][shape] = sums if before is None else [a + b for a, b in zip(before, sums, strict=True)]
        return [
            [self._indenter(pad, shape, sums) for shape, sums in shapes.items()]
            for pad, shapes in enumerate(found)
        ]

    def arrows(self) -> NDArray[np.float64]:
        """Return place and force of each contact with the object, world frame, float64 (k, 6), metres and newtons."""
        data, force = self._data, self._force
        places, frames = data.contact.pos, data.contact.frame
        rows = []
        for number, (_, other) in enumerate(data.contact.geom.tolist()):
            self._mujoco.mj_contactForce(self._model, data, number, force)
            if force[0] > 0:
                sign = 1.0 if other in self._object else -1.0
                rows.append([*places[number], *(sign * (frames[number].reshape(3, 3).T @ force[:3]))])
        return np.array(rows, np.float64).reshape(-1, 6)

    def _forces(self) -> list[tuple[int, int, float]]:
        """Return each contact's two shapes and its normal force, newtons."""
        data = self._data
        if not data.ncon:
            return []
        contact, forces = data.contact, data.efc_force
        # A cone's first row is the normal force; a contact that the solver left out has none.
        return [
            (one, other, float(forces[row]) if row >= 0 else 0.0)
            for (one, other), row in zip(contact.geom.tolist(), contact.efc_address.tolist(), strict=True)
        ]

    def _indenter(self, pad: int, shape: int, sums: list[float]) -> Indenter:
        force_n = sums[0]
        near = (sums[1] / force_n, sums[2] / force_n, sums[3] / force_n)
        normal = (sums[4], sums[5], sums[6])
        pose = _native.gel_pad_pose(
            self._pad_places[pad],
            near,
            normal,
            self._placed[shape],
            radius_m=PAD_RADIUS_M,
            half_length_m=PAD_HALF_LENGTH_M,
        )
        return Indenter("capsule", self._size_mm[shape], pose, force_n)


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
