"""Lead a Franka robot through franky: an impedance tracker in torque mode, so no discontinuity can trip it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from tega.arm.messages import HandSeen, Quaternion, Triple
from tega.devices.arm.robot.fci import Library, installed_library, server_version, the_fix
from tega.devices.arm.robot.leash import RobotBody
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.runtime.lifecycle import require

JOINT_LIMITS_RAD: Final = {
    "panda": (
        (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
    ),
    "fr3": (
        (-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159),
        (2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159),
    ),
}
"""Lowest and highest angles of the joints, by robot; given to the tracker, which pushes back before them."""

_TO_START_SHARE: Final = 0.05
_POSTURE_NM_RAD: Final = 5.0
# The robot's state is said to be new every millisecond; one that says nothing new for so long has gone.
_SILENT_NS: Final = 200_000_000
_RECOVERY_CHECKS: Final = 30
MODE_WORDS: Final = {
    "UserStopped": "the robot's stop is pressed; release it, then recover",
    "Guiding": "the robot is guided by hand",
    "Other": "the robot is locked; open its brakes in Desk",
    "Reflex": "the robot's reflex has stopped it; check for a collision, then recover",
}
"""Fixes for a robot's modes, by name."""


class FrankyBody(RobotBody):
    """Leads one Franka robot through franky."""

    def __init__(self, options: dict[str, Any]) -> None:
        self._o = options
        self._robot: Any = None
        self._tracker: Any = None
        self._fault = ""
        self._last_time: Any = None
        self._seen: HandSeen | None = None
        self._mode: Any = None

    def open(self) -> None:
        """Connect, clear old errors, set load and thresholds, and go to the start posture if one is given.

        ``WrongDeviceError``: its server's version is not the library's, or it is another model of robot.
        """
        franky = self._franky = require("franky", driver="franky", extra="arm")
        o, host = self._o, self._o["host"]
        library = installed_library()
        server = server_version(host)
        self._check(server, library)
        how = franky.RealtimeConfig.Ignore if o["realtime"] == "ignore" else franky.RealtimeConfig.Enforce
        try:
            self._robot = franky.Robot(host, realtime_config=how)
        except Exception as error:  # franky raises many kinds, of no common base
            raise DeviceUnavailableError(
                f"franky: {host} does not let itself be connected: {error}",
                "run `tega-teleop doctor SETTINGS.toml`; is another program connected?",
            ) from error
        name = "" if library is None else f"franky-control {library.version}, libfranka {library.libfranka}, "
        self.facts = (f"{name}robot server {server}",)
        if text := self.recover():
            raise DeviceUnavailableError(f"franky: {text}", "then start again")
        self._prepare()

    def _check(self, server: int, library: Library | None) -> None:
        model = "panda" if server <= 5 else "fr3"
        if fix := the_fix(server, library):
            own = "no library"
            if library is not None:
                own = f"libfranka {library.libfranka} for server {library.server}"
            raise WrongDeviceError(f"franky: the robot has server {server}, and here is {own}", fix)
        if model != self._o["robot"]:
            raise WrongDeviceError(
                f"franky: the robot is of kind {model!r}, and the settings say {self._o['robot']!r}",
                f"their joints have other limits; set robot = '{model}' if that is right",
            )

    def _prepare(self) -> None:
        o, robot, franky = self._o, self._robot, self._franky
        if o["start_rad"] is not None:
            self._check_start(o["start_rad"])
        try:
            robot.set_collision_behavior(o["torque_threshold_nm"], o["force_threshold_n"])
            if o["load_kg"] is not None:
                inertia = np.diag(o["load_inertia_kg_m2"]).ravel(order="F").tolist()
                robot.set_load(o["load_kg"], list(o["load_centre_m"]), inertia)
            if o["start_rad"] is not None:
                robot.relative_dynamics_factor = _TO_START_SHARE
                start = franky.JointState(np.array(o["start_rad"], np.float64))
                robot.move(franky.JointMotion(start))
        except Exception as error:
            raise DeviceUnavailableError(
                f"franky: the robot refuses to be prepared: {error}", "look at it in Desk"
            ) from error

    def _check_start(self, start_rad: Sequence[float]) -> None:
        low, high = JOINT_LIMITS_RAD[self._o["robot"]]
        for number, (angle, least, most) in enumerate(zip(start_rad, low, high, strict=True), start=1):
            if not least < angle < most:
                raise WrongDeviceError(
                    f"franky: start_rad of joint {number} is {angle:g}, outside {least:g} to {most:g}",
                    "joint 6 differs between Panda and FR3",
                )

    def observe(self) -> HandSeen:
        """Return where the hand is; a robot that sends nothing new gives the same again."""
        try:
            state = self._robot.state
        except Exception as error:
            self._break(f"the robot does not answer: {error}")
            if self._seen is None:
                raise DeviceUnavailableError(f"franky: {self._fault}") from error
            return self._seen
        now_ns = time.monotonic_ns()
        if self._seen is None or state.time != self._last_time:
            self._last_time = state.time
            pose = state.O_T_EE
            x, y, z = map(float, pose.translation)
            qx, qy, qz, qw = map(float, pose.quaternion)
            self._seen = HandSeen(now_ns, (x, y, z), (qx, qy, qz, qw))
            self.success_rate = float(state.control_command_success_rate)
            self._mode = state.robot_mode
        elif now_ns - self._seen.t_ns > _SILENT_NS:
            self._break("the robot says nothing new")
        return self._seen

    def begin(self) -> None:
        """Begin to follow; the tracker takes the present pose as its first target."""
        franky, o = self._franky, self._o
        low, high = JOINT_LIMITS_RAD[o["robot"]]
        try:
            self._tracker = franky.CartesianImpedanceTracker(
                self._robot,
                translational_stiffness=o["stiffness_n_m"],
                rotational_stiffness=o["stiffness_nm_rad"],
                translational_error_clip=np.full(3, o["clip_m"]),
                rotational_error_clip=np.full(3, o["clip_rad"]),
                posture_task=franky.PostureTask(
                    self._robot.current_joint_positions, stiffness=_POSTURE_NM_RAD
                ),
                max_delta_tau=o["torque_step_nm"],
                lower_joint_limits=np.array(low),
                upper_joint_limits=np.array(high),
            )
        except Exception as error:
            self._break(f"it does not begin: {error}")

    def lead(self, place: Triple, turn: Quaternion, velocity_m_s: Triple, velocity_rad_s: Triple) -> None:
        """Give the arm its next target."""
        if self._tracker is None:
            return
        franky = self._franky
        pose = franky.Affine(np.array(place), np.array(turn))
        self._tracker.set_target(pose, franky.Twist(np.array(velocity_m_s), np.array(velocity_rad_s)))

    def rest(self) -> None:
        """Begin to come to rest: torques fade to damping in 0.2 s."""
        if self._tracker is not None and self._robot.is_in_control:
            try:
                self._robot.move(self._franky.TorqueStopMotion(), asynchronous=True)
            except Exception as error:
                self._break(str(error))

    @property
    def in_control(self) -> bool:
        """Whether the arm follows or comes to rest."""
        return self._tracker is not None and bool(self._robot.is_in_control)

    def fault(self) -> str:
        """Return the fault that stopped the arm or keeps it from moving, ``""`` for none."""
        if self._fault or self._robot.is_in_control:
            return self._fault
        if self._tracker is None:
            if self._mode not in {None, self._franky.RobotMode.Idle, self._franky.RobotMode.Move}:
                self._break(self._words(self._mode))
            return self._fault
        self._tracker = None
        try:
            self._robot.join_motion(timeout=0.0)
        except Exception as error:
            self._break(self._named(str(error)))
        return self._fault

    def _named(self, text: str) -> str:
        try:
            state = self._robot.state
        except Exception:  # it does not answer any more; what franky says has to do
            return text
        return f"{text}: {self._words(state.robot_mode)}"

    @staticmethod
    def _words(mode: Any) -> str:
        name = str(mode).rpartition(".")[2]
        return MODE_WORDS.get(name, f"the robot's mode is {name}")

    def _break(self, text: str) -> None:
        self._fault = self._fault or " ".join(text.split())

    def recover(self) -> str:
        """Clear a fault; return the remaining fault, ``""`` if there is none."""
        self._tracker, self._fault = None, ""
        try:
            self._robot.recover_from_errors()
            cleared = self._is_idle()
        except Exception as error:
            self._break(self._named(f"it cannot be cleared: {error}"))
            return self._fault
        if not cleared:
            self._break(f"{self._words(self._mode)}; this state could not be cleared")
        return self._fault

    def _is_idle(self) -> bool:
        """Wait until the robot's state shows that it is idle; the word that it recovered comes before that."""
        for _ in range(_RECOVERY_CHECKS):
            self._mode = self._robot.state.robot_mode
            if self._mode == self._franky.RobotMode.Idle and not self._robot.has_errors:
                return True
            time.sleep(0.01)
        return False

    def close(self) -> None:
        """Come to rest and let go."""
        if self._robot is None:
            return
        self.rest()
        until_s = time.monotonic() + 3.0
        while self.in_control and time.monotonic() < until_s:
            time.sleep(0.01)
        try:
            self._robot.join_motion(timeout=0.5)
        except Exception as error:  # it has stopped all the same
            self._break(str(error))
        self._robot = self._tracker = None
