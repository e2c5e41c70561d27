"""Measure the lifted object, rigid core or elastic solid: where it stands, how fast it rises, how narrow it is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np

from tega.wire import HAND_FINGERS
from tega_sim.world.flex import AROUND, SKIN_M, UP
from tega_sim.world.objects import ObjectSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Boards that a flex is drawn of: half their thickness, and how far towards the axis those of its ends reach.
_BOARD_M: Final = 0.002
_WEDGE: Final = 0.8


class Shape(NamedTuple):
    """A primitive to draw.

    ``name`` is one of a kind. ``size_m``: half lengths; capsule, cylinder: radius, half length along z.
    """

    name: str
    kind: Literal["sphere", "capsule", "cylinder", "box", "plane"]
    size_m: tuple[float, float, float]
    rgba: tuple[float, float, float, float]


class Sprung:
    """A rigid core with a shell on springs for each finger.

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

    def shapes(self) -> list[Shape]:
        """Return nothing: the core is a shape of the model."""
        return []

    def poses(self) -> NDArray[np.float64]:
        """Return nothing, likewise."""
        return np.empty((0, 7))


class Flexed:
    """An elastic solid: nothing of its narrowing stays.

    Its middle is the mean of the wall halfway up. Narrowing is the largest shortening of a diameter of the
    mesh, at any height and in any direction.
    """

    def __init__(self, mujoco: Any, model: Any, data: Any, spec: ObjectSpec) -> None:
        self._mujoco, self._data, self._spec = mujoco, data, spec
        # Three nodes along each axis, z the fastest; each a body with a slide along x, y and z.
        nodes = model.flex_nodebodyid.reshape(3, 3, 3)
        self._nodes, self._slides = nodes, model.jnt_qposadr[model.body_jntadr[nodes]]
        self._dofs = model.body_dofadr[nodes]
        angles = 2 * np.pi * np.arange(AROUND) / AROUND
        along_x, along_y = _hats(np.cos(angles)), _hats(np.sin(angles))
        self._halfway = along_x @ along_y.T / AROUND
        self._points = data.flexvert_xpos.reshape(UP + 1, AROUND + 1, 3)

    def move(self, x_m: float, y_m: float) -> None:
        """Put the object elsewhere on the table."""
        self._data.qpos[self._slides] += x_m
        self._data.qpos[self._slides + 1] += y_m

    def push(self, force_n: float) -> None:
        """Push the object down from now on, every node alike."""
        self._data.xfrc_applied[self._nodes, 2] = -force_n / self._nodes.size

    def middle_m(self) -> tuple[float, float, float]:
        """Return where the wall halfway up is, in the mean."""
        x, y, z = np.tensordot(self._halfway, self._data.xpos[self._nodes[:, :, 1]], 2).tolist()
        return x, y, z

    def upright(self) -> tuple[float, float, float]:
        """Return the direction from the bottom's middle to the top's."""
        axis = self._points[-1, 0] - self._points[0, 0]
        x, y, z = (axis / math.sqrt(axis @ axis)).tolist()
        return x, y, z

    def rise_m_s(self) -> float:
        """Return how fast the object's middle goes up."""
        return float(np.tensordot(self._halfway, self._data.qvel[self._dofs[:, :, 1] + 2], 2))

    def lowest_m(self) -> float:
        """Return the height of the object's lowest point."""
        return float(self._points[..., 2].min()) - SKIN_M

    def narrowing_m(self) -> float:
        """Return how much narrower the object is than untouched."""
        wall = self._points[:, 1:]
        across = wall[:, : AROUND // 2] - wall[:, AROUND // 2 :]
        shortest = math.sqrt(np.einsum("ijk,ijk->ij", across, across).min())
        return max(0.0, self._spec.diameter_m - shortest)

    def damage_m(self) -> float:
        """Return nothing."""
        return 0.0

    def shapes(self) -> list[Shape]:
        """Return boxes of fixed sizes: the wall in staves, the two ends in wedges that overlap."""
        spec = self._spec
        wide, tall = spec.diameter_m / 2 * math.sin(math.pi / AROUND), spec.height_m / UP / 2
        stave, wedge = (wide, _BOARD_M, tall), (wide, _WEDGE * spec.diameter_m / 4, _BOARD_M)
        return [
            Shape(f"object{number}", "box", stave if number < UP * AROUND else wedge, spec.rgba)
            for number in range((UP + 2) * AROUND)
        ]

    def poses(self) -> NDArray[np.float64]:
        """Return where the boxes are, float64 (n, 7)."""
        wall, ends = self._points[:, 1:], self._points[[0, -1], :1]
        beside = np.roll(wall, -1, axis=1)
        edges, chords = (wall + beside) / 2, beside - wall
        staves = (edges[:-1] + edges[1:]) / 2
        inward = ends - edges[[0, -1]]
        wedges = edges[[0, -1]] + _WEDGE / 2 * inward
        z = np.concatenate([edges[1:] - edges[:-1], np.cross(chords[[0, -1]], inward)]).reshape(-1, 3)
        x = np.concatenate([chords[:-1] + chords[1:], chords[[0, -1]]]).reshape(-1, 3)
        z /= np.linalg.norm(z, axis=1, keepdims=True)
        y = np.cross(z, x)
        y /= np.linalg.norm(y, axis=1, keepdims=True)
        turned = np.stack([np.cross(y, z), y, z], axis=2).reshape(-1, 9)
        poses = np.empty((len(turned), 7))
        poses[:, :3] = np.concatenate([staves, wedges]).reshape(-1, 3)
        for pose, turn in zip(poses, turned, strict=True):
            self._mujoco.mju_mat2Quat(pose[3:], turn)
        return poses


LiftedBody: TypeAlias = Sprung | Flexed
"""A lifted object, to be measured; all of it in the world frame."""


def body_of(mujoco: Any, model: Any, data: Any, spec: ObjectSpec) -> LiftedBody:
    """Return the object of a model, to ask."""
    return Flexed(mujoco, model, data, spec) if spec.shell == "flex" else Sprung(model, data, spec)


def _hats(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shares, float64 (3, n), of nodes at -1, 0 and 1 in what lies between them."""
    return np.stack([np.maximum(0.0, -places), 1 - np.abs(places), np.maximum(0.0, places)])


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
