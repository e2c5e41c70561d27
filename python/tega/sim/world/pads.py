"""What presses each fingertip: contacts of the physics, as shapes before a flat gel.

The pad of the physics is rounded across the finger (a capsule), so that a fingertip twists and rolls as a soft one
does; the gel of the picture is flat. A contact beside the middle of the rounding therefore comes to the pad frame
unrolled: as far from the middle as along the surface, with its normal upright.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tega.sim.seams import Indenter
from tega.sim.world.allegro import FINGERS, PAD_HALF_LENGTH_M, PAD_RADIUS_M

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["SEAM_FINGERS", "Touch"]

SEAM_FINGERS = ("thumb", "index", "middle", "ring")
"""The order of fingers outside the world."""

# Pad axes in the frame of the last link: x to the right in the upright picture, y down (towards the palm), z out.
_PAD_IN_LINK = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


class Touch:
    """Reads the contacts of a model: forces on pads, links and palm, and shapes before the pads.

    Args:
        mujoco: The module.
        model: The world's model.
        data: Its state.
    """

    def __init__(self, mujoco: Any, model: Any, data: Any) -> None:
        self._mujoco, self._model, self._data = mujoco, model, data
        self._pads = {model.geom(f"{finger}_pad").id: i for i, finger in enumerate(SEAM_FINGERS)}
        self._sites = [model.site(f"{finger}_pad").id for finger in SEAM_FINGERS]
        self._table = model.geom("table").id
        shells = [model.geom(f"{finger}_shell").id for finger in FINGERS]
        self._object = {*shells, model.geom("core").id, model.geom("object").id}
        self._force = np.zeros(6)

    def read(self) -> tuple[list[float], float, float]:
        """Return normal forces, newtons: on each pad thumb first, on the rest of the hand, on the table."""
        pads, rest, table = [0.0, 0.0, 0.0, 0.0], 0.0, 0.0
        data, force = self._data, self._force
        for number, (one, other) in enumerate(data.contact.geom.tolist()):
            self._mujoco.mj_contactForce(self._model, data, number, force)
            newtons = float(force[0])
            pad = self._pads.get(one, self._pads.get(other))
            if pad is not None:
                pads[pad] += newtons
            elif self._table in (one, other):
                table += newtons
            else:
                rest += newtons
        return pads, rest, table

    def indenters(self) -> list[list[Indenter]]:
        """Return the shapes that press each pad, thumb first; at most one a pad and primitive."""
        found: list[dict[int, tuple[float, NDArray[np.float64], NDArray[np.float64]]]] = [
            {} for _ in SEAM_FINGERS
        ]
        data, force = self._data, self._force
        places, frames = data.contact.pos, data.contact.frame
        for number, (one, other) in enumerate(data.contact.geom.tolist()):
            pad, shape, sign = self._pads.get(one), other, 1.0
            if pad is None:
                pad, shape, sign = self._pads.get(other), one, -1.0
            if pad is None:
                continue
            self._mujoco.mj_contactForce(self._model, data, number, force)
            newtons = float(force[0])
            if newtons <= 0:
                continue
            place, normal = newtons * places[number], (sign * newtons) * frames[number, :3]
            if shape in found[pad]:
                before = found[pad][shape]
                newtons, place, normal = before[0] + newtons, before[1] + place, before[2] + normal
            found[pad][shape] = newtons, place, normal
        return [
            [self._indenter(pad, shape, *sums) for shape, sums in shapes.items()]
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

    def _indenter(
        self, pad: int, shape: int, force_n: float, place: NDArray[np.float64], normal: NDArray[np.float64]
    ) -> Indenter:
        data, model, site = self._data, self._model, self._sites[pad]
        to_world = data.site_xmat[site].reshape(3, 3) @ _PAD_IN_LINK
        origin = data.site_xpos[site]
        contact = to_world.T @ (place / force_n - origin)
        up = to_world.T @ (normal / np.sqrt(normal @ normal))
        centre = to_world.T @ (data.geom_xpos[shape] - origin)
        turned = to_world.T @ data.geom_xmat[shape].reshape(3, 3)
        # Unroll: turn the normal upright, and put the contact where the surface has it.
        axis = np.array([up[1], -up[0], 0.0])
        sine = float(np.sqrt(axis @ axis))
        angle = float(np.arctan2(sine, up[2]))
        along = min(max(contact[1] - PAD_RADIUS_M * up[1], -PAD_HALF_LENGTH_M), PAD_HALF_LENGTH_M)
        flat = np.array([0.0, along, 0.0])
        upright = np.eye(3)
        if sine > 1e-9:
            axis /= sine
            flat[:2] += PAD_RADIUS_M * angle * up[:2] / sine
            x, y, _ = axis
            cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
            upright = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        pose = np.empty((3, 4))
        pose[:, :3] = upright @ turned
        pose[:, 3] = 1e3 * (flat + upright @ (centre - contact))
        radius, half = 1e3 * model.geom_size[shape, 0], 1e3 * model.geom_size[shape, 1]
        return Indenter("capsule", (float(radius), float(half), 0.0), pose, float(force_n))
