"""Turn the contacts of the physics on each fingertip into shapes that press its gel.

The pad of the physics is rounded more than the gel of the picture (a capsule), so that a fingertip twists and rolls as
a soft one does. A contact beside the middle of the rounding therefore comes to the pad frame unrolled and rolled again
(``pad_pose`` of the crate ``tega-gel``).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tega import _native
from tega.hand.mjcf import PAD_HALF_LENGTH_M, PAD_RADIUS_M
from tega.haptics import FINGERS
from tega.wire import HAND_FINGERS
from tega_sim.seams import Indenter
from tega_sim.world.body import LiftedBody
from tega_sim.world.objects import ObjectSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray


_FLEX = -1
"""Shape number of a flex in a contact of MuJoCo."""


class PadContacts:
    """Reads a model's contacts: forces on pads, links and palm, and shapes before the pads."""

    def __init__(self, mujoco: Any, model: Any, data: Any, spec: ObjectSpec, body: LiftedBody) -> None:
        self._mujoco, self._model, self._data = mujoco, model, data
        self._pads = {model.geom(f"{finger}_pad").id: i for i, finger in enumerate(FINGERS)}
        # Places and rotations are views of MuJoCo's own memory: they follow the state.
        sites = [model.site(f"{finger}_pad").id for finger in FINGERS]
        self._pad_places = [(data.site_xpos[site], data.site_xmat[site]) for site in sites]
        self._table = model.geom("table").id
        self._body = body
        radius = spec.diameter_m / 2
        if spec.shell == "flex":
            self._object, sizes = {_FLEX}, {_FLEX: [radius, spec.height_m / 2 - radius]}
            self._placed = {}
        else:
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
        placed = self._flexed(near, normal) if shape == _FLEX else self._placed[shape]
        pose = _native.gel_pad_pose(
            self._pad_places[pad],
            near,
            normal,
            placed,
            radius_m=PAD_RADIUS_M,
            half_length_m=PAD_HALF_LENGTH_M,
        )
        return Indenter("capsule", self._size_mm[shape], pose, force_n)

    def _flexed(
        self, near_m: tuple[float, float, float], normal: tuple[float, float, float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where a capsule as wide as the untouched object lies that touches at a place as the flex does.

        A flex has no primitive. The capsule lies along the wall, as upright as the object; that the wall is flatter
        where it is squeezed is not in it.
        """
        out = np.array(normal)
        out /= math.sqrt(out @ out)
        axis = np.array(self._body.upright())
        along = axis - (axis @ out) * out
        along /= math.sqrt(along @ along)
        where = near_m + 1e-3 * self._size_mm[_FLEX][0] * out
        return where, np.stack([out, np.cross(along, out), along], axis=1).ravel()
