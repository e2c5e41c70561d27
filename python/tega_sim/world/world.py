"""Simulate hand, arm, table and one object, in steps of physics."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.errors import InvalidValueError, ShapeError
from tega.hand.mjcf import TORQUE_LIMITS_NM, joint_names
from tega_sim.seams import Indenter, WorldTruth
from tega_sim.world.body import LiftedBody, Shape
from tega_sim.world.follower import ArmFollower
from tega_sim.world.objects import OBJECTS, ObjectSpec
from tega_sim.world.scene import GRASP_POSES_RAD, PALM_ROTATION, build, grasp_palm_m, import_mujoco, step_s
from tega_sim.world.truth import PadContacts, Witness

_ATTEND_S = 12e-3
_SETTLE_S = 0.3
_PLACING_M = 1e-3
_BACK: NDArray[np.float64] = -np.array([0.5, 0.75**0.5, 0.0])
"""The way back from the grasp pose: 30° from straight out of the palm."""


class World:
    """A hand on an arm before an object on a table.

    The hand takes torques, the arm a place to lead the hand to; both keep theirs until they are given new
    ones. World frame: metres, z up, the origin on the table where the object is to stand; in the grasp pose
    the fingers point along x and the palm faces y. The same arguments and calls give the same bits.

    ``spec`` is an object, or the name of one of :data:`~tega_sim.world.OBJECTS`. ``seed`` draws its exact
    place: off its mark by a normal deviate of 1 mm in x and y. ``start_m`` is where the hand waits: height
    over the grasp pose and distance back from it. ``model`` and ``data``, MuJoCo's, are to read, not to
    change.
    """

    def __init__(
        self,
        spec: ObjectSpec | str,
        *,
        seed: int = 0,
        start_m: tuple[float, float] = (0.0, 0.15),
    ) -> None:
        """Build the scene and let the object come to rest."""
        if isinstance(spec, str):
            if spec not in OBJECTS:
                raise InvalidValueError(f"there is no object {spec!r}", f"one of {', '.join(OBJECTS)}")
            spec = OBJECTS[spec]
        self.spec, self._step_s = spec, step_s(spec)
        self.mujoco = mujoco = import_mujoco()
        self.model = model = build(mujoco, spec, self._step_s)
        self.data = data = mujoco.MjData(model)
        self._grasp = grasp_palm_m(spec)
        # Views of MuJoCo's own memory: they follow the state. The hand's joints lie in it one after the other.
        first, dof = model.joint(joint_names()[0]).qposadr[0], model.joint(joint_names()[0]).dofadr[0]
        self._angles, self._velocities = data.qpos[first : first + 16], data.qvel[dof : dof + 16]
        self._torques = data.ctrl[7:23]
        self._palm_body, self._palm = model.body("palm").id, model.site("palm").id
        self._hand_weight_n = 9.81 * float(model.body_subtreemass[self._palm_body])
        self._forearm_m: tuple[float, float] | None = None
        self._arm = ArmFollower(mujoco, model, self._place(*start_m), PALM_ROTATION)
        data.qpos[:7] = data.act[:7] = self._arm.angles_rad
        self._angles[:] = GRASP_POSES_RAD[0]
        self._body = LiftedBody(model, data, spec)
        self._body.move(*np.random.default_rng(seed).normal(0, _PLACING_M, 2))
        kinds = mujoco.mjtWarning
        self._runaway = [
            int(one) for one in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        ]
        self._steps = 0
        self._attend_every = max(1, round(_ATTEND_S / self._step_s))
        self._jacobian, self._velocity = np.zeros((3, model.nv)), np.zeros(6)
        mujoco.mj_forward(model, data)
        self._touch = PadContacts(mujoco, model, data)
        self._witness: Witness | None = None
        for _ in range(round(_SETTLE_S / self._step_s)):  # the object settles, the hand is held by its joints
            error = GRASP_POSES_RAD[0] - self.angles_rad
            self.set_torques(1.5 * error - 0.08 * self.velocities_rad_s)
            self.step(1)
        self._witness = Witness(model, data, spec, self._touch, self._body)
        self._steps = 0
        self._drawn = np.flatnonzero(model.geom_rgba[:, 3] > 0)

    @property
    def t_s(self) -> float:
        """Simulated time, seconds."""
        return self._steps * self._step_s

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The hand's joint angles, float64 (16,), in the order of :data:`tega.hand.JOINT_NAMES`."""
        return np.array(self._angles)

    @property
    def velocities_rad_s(self) -> NDArray[np.float64]:
        """The hand's joint velocities, float64 (16,)."""
        return np.array(self._velocities)

    @property
    def palm_pose(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the palm is and how it is turned, world frame: float64 (3,) metres and (3, 3)."""
        data = self.data
        return np.array(data.site_xpos[self._palm]), np.array(data.site_xmat[self._palm]).reshape(3, 3)

    @property
    def palm_row(self) -> NDArray[np.float64]:
        """Where the palm is, float64 (7,), as a row of :meth:`poses`."""
        row = np.empty(7)
        row[:3], row[3:] = self.data.xpos[self._palm_body], self.data.xquat[self._palm_body]
        return row

    @property
    def object_pose(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the object's middle is and where its axis points, world frame: float64 (3,) metres and (3,)."""
        return np.array(self._body.middle_m()), np.array(self._body.upright())

    def set_torques(self, torques_nm: ArrayLike) -> None:
        """Set the hand's joint torques, (16,), cut to the vendor's limits.

        They are torque units times :data:`~tega_sim.world.FULL_DUTY_NM`. Where one is not finite nothing
        changes, and :class:`InvalidValueError` is raised.
        """
        torques = np.asarray(torques_nm, np.float64)
        if torques.shape != (16,):
            raise ShapeError(f"torques_nm has shape {torques.shape}, not (16,)")
        if not _native.limit_torques(torques, TORQUE_LIMITS_NM, self._torques):
            raise InvalidValueError(f"torques_nm has a value that is not finite: {torques}")

    def set_forearm(self, forearm_m: tuple[float, float]) -> None:
        """Lead the hand to a height over the grasp pose and a distance back from it (``Act.forearm_m``).

        Outside -0.05 to 0.35 m of height or -0.05 to 0.2 m back it raises :class:`InvalidValueError`.
        """
        if forearm_m == self._forearm_m:
            return
        height, back = forearm_m
        if not (-0.05 <= height <= 0.35 and -0.05 <= back <= 0.2):
            raise InvalidValueError(
                f"the hand cannot go to {height} m height, {back} m back",
                "height -0.05 to 0.35 m, back -0.05 to 0.2 m",
            )
        self._arm.lead(self._place(height, back))
        self._forearm_m = forearm_m

    def push(self, force_n: float) -> None:
        """Push the object's middle down, besides its weight, until the next call: a knock, or a filling.

        The force must be finite and 0 or more.
        """
        if not 0 <= force_n < math.inf:
            raise InvalidValueError(f"force_n = {force_n} N has to be at least 0 N and finite")
        self._body.push(force_n)

    def set_palm(self, palm_m: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Lead the palm to a place, (3,), and turn, (3, 3), palm to world, both in the world frame.

        ``None``: turned as it is led now.
        """
        turn = None if rotation is None else np.asarray(rotation, np.float64)
        self._forearm_m = None
        self._arm.lead(np.array(palm_m, np.float64), turn)

    def step(self, n: int = 1) -> None:
        """Go on by ``n`` steps of physics.

        Steps too long for a wall this stiff make the motion run away: that raises :class:`InvalidValueError`.
        """
        every, done = self._attend_every, 0
        while done < n:
            if self._steps % every == 0:
                self._attend()
            chunk = min(n - done, every - self._steps % every)
            self.mujoco.mj_step(self.model, self.data, chunk)
            self._steps += chunk
            done += chunk

    def advance_to(self, t_s: float) -> None:
        """Go on to the first step at or after a time."""
        # A step that ends a rounding error short of the time has reached it.
        steps = math.ceil(t_s / self._step_s - 1e-6)
        if steps > self._steps:
            self.step(steps - self._steps)

    def truth(self) -> WorldTruth:
        """Return the true state now."""
        assert self._witness is not None
        return self._witness.truth(self.t_s, self._palm_speed_m_s)

    def pads(self) -> list[list[Indenter]]:
        """Return the shapes that press each fingertip, thumb first; an empty list where nothing does."""
        return self._touch.indenters()

    @property
    def hand_height_m(self) -> float:
        """Height of the palm over its place in the grasp pose, metres: where the arm is, not where it is led."""
        return float(self.data.site_xpos[self._palm][2] - self._grasp[2])

    def shapes(self) -> list[Shape]:
        """Return the primitives to draw, in the order of :meth:`poses`."""
        kinds, model = self.mujoco.mjtGeom, self.model
        return [
            Shape(
                model.geom(i).name or f"part{i}",
                kinds(model.geom_type[i]).name.removeprefix("mjGEOM_").lower(),
                tuple(model.geom_size[i].tolist()),
                tuple(model.geom_rgba[i].tolist()),
            )
            for i in self._drawn
        ]

    def poses(self) -> NDArray[np.float64]:
        """Return where the primitives are: float64 (n, 7), position in metres and quaternion w, x, y, z."""
        poses = np.empty((len(self._drawn), 7))
        poses[:, :3] = self.data.geom_xpos[self._drawn]
        for row, i in enumerate(self._drawn):
            self.mujoco.mju_mat2Quat(poses[row, 3:], self.data.geom_xmat[i])
        return poses

    def contact_points(self) -> NDArray[np.float64]:
        """Return each contact's place and the force on the object there, float64 (k, 6), metres and newtons."""
        return self._touch.arrows()

    def mark_m(self, away_m: float) -> NDArray[np.float64]:
        """Return the mark on the table so far back of the one where the object stands, float64 (3,), metres."""
        return away_m * _BACK

    def _place(self, height_m: float, back_m: float) -> NDArray[np.float64]:
        # Back is away from the palm, and somewhat from the fingertips: so an open hand comes to the object untouched.
        place: NDArray[np.float64] = self._grasp + back_m * _BACK + np.array([0.0, 0.0, height_m])
        return place

    def _attend(self) -> None:
        """Do the work between steps: lead the arm, carry the hand's weight, note the state."""
        warnings = self.data.warning.number.tolist()
        if any(warnings[kind] for kind in self._runaway):
            raise InvalidValueError(
                f"the motion ran away before {self.t_s:.3f} s with steps of {1e3 * self._step_s:g} ms and a "
                f"wall of {self.spec.stiffness_n_m:g} N/m",
                "use shorter steps",
            )
        # The set angles move evenly from one look to the next: steps of them would shake what the hand holds.
        tick_s = self._attend_every * self._step_s
        self._arm.tick(tick_s)
        self.data.ctrl[:7] = (self._arm.angles_rad - self.data.act) / tick_s
        self.mujoco.mj_jacSubtreeCom(self.model, self.data, self._jacobian, self._palm_body)
        self.data.qfrc_applied[:7] = self._hand_weight_n * self._jacobian[2, :7]
        if self._witness is not None:
            self._witness.watch()

    def _palm_speed_m_s(self) -> float:
        kind = self.mujoco.mjtObj.mjOBJ_SITE
        self.mujoco.mj_objectVelocity(self.model, self.data, kind, self._palm, self._velocity, 0)
        return float(self._velocity[5])
