"""Lead a Franka robot through panda-python's Cartesian impedance controller in torque mode. Never run on a robot."""

from __future__ import annotations

import threading
import time
from typing import Any, Final

import numpy as np

from tega.arm.clip import clipped
from tega.arm.messages import Quaternion, Triple
from tega.arm.pose import Pose
from tega.arm.rotation import from_matrix
from tega.arm.settings import LimitSettings
from tega.devices.arm.robot.body import HandSeen
from tega.devices.arm.robot.fci import server_version
from tega.devices.arm.robot.franky_body import JOINT_LIMITS_RAD, MODE_WORDS
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.runtime.lifecycle import require

_TO_START_SHARE: Final = 0.05
_POSTURE_NM_RAD: Final = 5.0
_SILENT_NS: Final = 200_000_000
_RECOVERY_LOOKS: Final = 30
_STOP_S: Final = 3.0


class PandaBody:
    """Leads one Franka robot through panda-python.

    panda-python clips no error and supervises nothing, so this class clips the target to the measured pose at every
    tick. panda-python also clears a reflex when a controller starts, so no controller is started during a reflex.

    Args:
        options: Those of :class:`tega.devices.arm.panda_arm.PandaArmOptions`.
    """

    def __init__(self, options: dict[str, Any]) -> None:
        self._o = options
        self._clip = LimitSettings(ahead_m=options["clip_m"], ahead_rad=options["clip_rad"])
        self._robot: Any = None
        self._controller: Any = None
        self._stopping: threading.Thread | None = None
        self._posture: Any = None
        self._fault = ""
        self._last_ms: int | None = None
        self._seen: HandSeen | None = None
        self.facts: tuple[str, ...] = ()
        self.success_rate: float | None = None

    def open(self) -> None:
        """Connect, clear old errors, set load and thresholds, and go to the start posture if one is given.

        Raises:
            MissingExtraError: panda-python is not installed.
            DeviceUnavailableError: The robot is not there, or does not let itself be steered.
            WrongDeviceError: Its server is of another version than the library.
        """
        panda_py = require("panda_py", driver="panda", extra="panda")
        self._controllers = require("panda_py.controllers", driver="panda", extra="panda")
        self._libfranka = require("panda_py.libfranka", driver="panda", extra="panda")
        host, configs = self._o["host"], self._libfranka.RealtimeConfig
        server = server_version(host)
        how = configs.kIgnore if self._o["realtime"] == "ignore" else configs.kEnforce
        try:
            self._robot = panda_py.Panda(host, realtime_config=how)
        except panda_py.IncompatibleVersionError as error:
            raise WrongDeviceError(
                f"panda: the robot has server {server}, and panda-python here speaks to server "
                f"{error.library_version}",
                "install the build for it that panda-python's README names, or use the driver franky",
            ) from error
        except Exception as error:  # libfranka's errors come as several kinds
            raise DeviceUnavailableError(
                f"panda: {host} does not let itself be connected: {error}",
                "run `tega-teleop arm check HOST`; is another program connected?",
            ) from error
        self.facts = (f"panda-python {panda_py.__version__}, robot server {server}; never tried on a robot",)
        if said := self.recover():
            raise DeviceUnavailableError(f"panda: {said}", "then start again")
        self._prepare()

    def _prepare(self) -> None:
        o, robot = self._o, self._robot.get_robot()
        start = o["start_rad"]
        low, high = JOINT_LIMITS_RAD["panda"]
        if start is not None and not all(a < x < b for a, x, b in zip(low, start, high, strict=True)):
            raise WrongDeviceError(
                f"panda: start_rad {start} is outside of the Panda's joints", "see docs/device-arm.md"
            )
        torques, forces = [o["torque_threshold_nm"]] * 7, [o["force_threshold_n"]] * 6
        try:
            robot.set_collision_behavior(torques, torques, forces, forces)
            if o["load_kg"] is not None:
                inertia = np.diag(o["load_inertia_kg_m2"]).ravel(order="F").tolist()
                robot.set_load(o["load_kg"], list(o["load_centre_m"]), inertia)
            there = start is None or self._robot.move_to_joint_position(
                np.array(start), speed_factor=_TO_START_SHARE
            )
        except Exception as error:
            raise DeviceUnavailableError(
                f"panda: the robot refuses to be prepared: {error}", "look at it in Desk"
            ) from error
        if not there:
            raise DeviceUnavailableError("panda: the robot did not come to start_rad", "look at it in Desk")

    def see(self) -> HandSeen:
        """Return where the hand is; a robot that says nothing new gives the same again."""
        try:
            state = self._robot.get_state()
        except Exception as error:
            self._break(f"the robot does not answer: {error}")
            if self._seen is None:
                raise DeviceUnavailableError(f"panda: {self._fault}") from error
            return self._seen
        now_ns, now_ms = time.monotonic_ns(), state.time.to_msec()
        if self._seen is None or now_ms != self._last_ms:
            self._last_ms = now_ms
            matrix = np.array(state.O_T_EE).reshape(4, 4, order="F")  # libfranka counts down the columns
            x, y, z = matrix[:3, 3].tolist()
            qx, qy, qz, qw = from_matrix(matrix[:3, :3]).tolist()
            self._seen = HandSeen(now_ns, (x, y, z), (qx, qy, qz, qw))
            self.success_rate = float(state.control_command_success_rate)
        elif now_ns - self._seen.t_ns > _SILENT_NS:
            self._break("the robot says nothing new")
        return self._seen

    def begin(self) -> None:
        """Begin to follow; the controller takes the present pose as its first target."""
        try:
            self._join()
            state = self._robot.get_state()
            if said := self._hinders(state):
                self._break(said)
                return
            o = self._o
            stiffness = np.diag([o["stiffness_n_m"]] * 3 + [o["stiffness_nm_rad"]] * 3)
            controller = self._controllers.CartesianImpedance(
                impedance=stiffness, damping_ratio=1.0, nullspace_stiffness=_POSTURE_NM_RAD, filter_coeff=1.0
            )
            self._posture = np.array(state.q)
            self._robot.start_controller(controller)
        except Exception as error:
            self._break(f"it does not begin: {error}")
            return
        self._controller = controller

    def lead(
        self,
        place: Triple,
        turn: Quaternion,
        velocity_m_s: Triple,  # noqa: ARG002  # its controller takes no speeds
        velocity_rad_s: Triple,  # noqa: ARG002
    ) -> None:
        """Give the arm its next target, not farther from where the hand is than the clip."""
        if self._controller is None or self._seen is None:
            return
        here = Pose(np.array(self._seen.place), np.array(self._seen.turn))
        near = clipped(Pose(np.array(place), np.array(turn)), here, self._clip)
        self._controller.set_control(near.position_m, near.quaternion_xyzw, self._posture)

    def rest(self) -> None:
        """End the motion in a thread, since the library waits for that; the robot then holds by its own control."""
        if self._controller is None or self._stopping is not None:
            return
        self._stopping = threading.Thread(target=self._stop, name="tega-panda-stop", daemon=True)
        self._stopping.start()

    def _stop(self) -> None:
        try:
            self._robot.stop_controller()
        except Exception as error:
            self._break(f"it did not stop: {error}")
        self._controller = None

    def _join(self) -> None:
        if self._stopping is not None:
            self._stopping.join(_STOP_S)
            self._stopping = None

    @property
    def in_control(self) -> bool:
        """Whether the arm follows or comes to rest."""
        return self._controller is not None

    def fault(self) -> str:
        """Return the fault that stopped the arm or keeps it from moving, ``""`` for none."""
        if self._stopping is not None and not self._stopping.is_alive():
            self._stopping = None
        try:
            self._robot.raise_error()
            if self._controller is None and (said := self._hinders(self._robot.get_state())):
                self._break(said)
        except Exception as error:  # what the control thread died of
            self._break(str(error))
        return self._fault

    def _hinders(self, state: Any) -> str:
        """Return the part of the robot's state that keeps it from moving."""
        name = str(state.robot_mode).rpartition(".")[2].removeprefix("k")
        if name in {"Idle", "Move"} and not state.current_errors:
            return ""
        said = MODE_WORDS.get(name, f"the robot's mode is {name}")
        return f"{said}: {state.current_errors}" if state.current_errors else said

    def _break(self, said: str) -> None:
        self._fault = self._fault or " ".join(said.split())

    def recover(self) -> str:
        """Clear a fault; return the remaining fault, ``""`` if there is none."""
        self._fault = ""
        try:
            self.rest()
            self._join()
            self._robot.recover()
            for _ in range(_RECOVERY_LOOKS):
                said = self._hinders(self._robot.get_state())
                if not said:
                    return ""
                time.sleep(0.01)
            self._break(said)
        except Exception as error:
            self._break(f"it cannot be cleared: {error}")
        return self._fault

    def close(self) -> None:
        """End the motion and let go."""
        if self._robot is not None:
            self.rest()
            self._join()
            self._robot = None
