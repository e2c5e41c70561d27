"""franky-sim's robot with faults that it does not have by itself: ``python -m tega_emulators.franka_faults``.

Physics, protocol and joints are franky-sim's own (an FR3 in MuJoCo, robot server 10). It knows no limits and no
reflexes; here they are **injected**: what a real robot would do to end up there, and when, is not shown by this.
With ``--hand-kg`` a hand of that weight hangs at the flange, in the physics; the robot knows of it only what its client
tells it. It obeys::

    reflex            a cartesian_reflex ends the motion; cleared by the recovery
    late              a communication_constraints_violation ends the motion; likewise
    press, release    the stop: ends the motion; recovery is refused until it is released
    locked            a fault that no recovery clears
    rate SHARE        the success rate of the commands
    freeze, thaw      the robot says nothing any more
    refuse N          a robot server N that takes no other library; from the next connection on
    look              joints, load and mode
    end               no fault any more
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import select
import struct
import sys
import time
import xml.etree.ElementTree as ET
from typing import Any

from tega_emulators.pipe import notify, obey_next

__all__ = ["HAND_CENTRE_M", "HAND_KG", "main", "on_franky_sim"]

HAND_KG = 1.1
"""What an Allegro Hand weighs with its adapter, about."""
HAND_CENTRE_M = (0.0, 0.0, 0.06)
"""Its centre of mass from the flange; a guess, no adapter was measured."""

# Numbers of libfranka's errors.
_ERRORS = {"cartesian_reflex": 7, "communication_constraints_violation": 25}
_N_ERRORS = 41


def on_franky_sim(host: str) -> dict[str, Any]:
    """Return an ``[arm]`` table that leads this robot, listening at ``host``, and the hand on it."""
    options = {
        "host": host,
        "robot": "fr3",
        "realtime": "ignore",
        "load_kg": HAND_KG,
        "load_centre_m": list(HAND_CENTRE_M),
    }
    # Its flange looks down, and the table is 20 cm below where its fingers would be.
    return {"options": options, "limits": {"upright": [0.0, 0.0, -1.0], "low_m": [0.3, -0.4, 0.2]}}


class _Fault:
    """What is wrong now."""

    def __init__(self) -> None:
        self.end()

    def end(self) -> None:
        self.error = ""
        self.stopped = self.locked = self.frozen = False
        self.rate = 1.0
        self.refuse: int | None = None


def _server_class(fault: _Fault) -> Any:
    """Return franky-sim's server with the fault in it."""
    protocol = importlib.import_module("franky_sim.franka_robot_protocol")
    base: Any = importlib.import_module("franky_sim.franka_robot_server")
    wire: Any = importlib.import_module("franky_sim.franka_server")

    class Recovery(protocol.AutomaticErrorRecoveryCommand):  # type: ignore[name-defined,misc]
        def handle(self, server: Any) -> None:  # noqa: ARG002  # the shape of franky-sim's commands
            status = protocol.AutomaticErrorRecoveryStatus
            if fault.stopped:
                self.reply(status.kCommandRejectedDueToActivatedSafetyFunctions)
            elif fault.locked:
                self.reply(status.kManualErrorRecoveryRequiredRejected)
            else:
                fault.error = ""
                self.reply(status.kSuccess)

    class Connect(wire.ConnectCommand):  # type: ignore[misc]
        def handle(self, server: Any, command_type_struct: str = "I") -> None:
            if fault.refuse is None:
                super().handle(server, command_type_struct=command_type_struct)
                return
            # As robots pack it, not as franky-sim does: libfranka looks at the version only here.
            header = struct.pack("<III", 0, self.command_id, 15)
            self.client_socket.sendall(header + struct.pack("<BH", 1, fault.refuse))

    base.AutomaticErrorRecoveryCommand = Recovery
    wire.ConnectCommand = Connect

    class Server(base.FrankaRobotServer):  # type: ignore[misc]
        def abort(self, status: Any) -> None:
            """End the motion as a robot does that stops by itself."""
            motion = self.current_motion_id
            self.stop_motion(send_preemption_signal=False)
            if motion:
                command = protocol.RobotCommand.kMove
                protocol.BaseCommand.send_response(self._tcp_socket, command, motion, status)
            self.reset_current_motion_id()

        @property
        def robot_state(self) -> Any:
            state = super().robot_state
            mode = protocol.RobotMode
            errors = [False] * _N_ERRORS
            if fault.error:
                errors[_ERRORS[fault.error]] = True
                state = state.replace(robot_mode=mode.kReflex)
            if fault.stopped:
                state = state.replace(robot_mode=mode.kUserStopped)
            return state.replace(
                errors=tuple(errors),
                reflex_reason=tuple(errors),
                control_command_success_rate=fault.rate,
            )

    return Server


class _FrankaEmulator:
    def __init__(self, hand_kg: float) -> None:
        self._fault = _Fault()
        self._hand_kg = hand_kg
        simulator = importlib.import_module("franky_sim.mujoco_simulator").MujocoSimulator
        self._sim = simulator(enable_visualization=False)
        self._server_type = _server_class(self._fault)
        self._status = importlib.import_module("franky_sim.franka_robot_protocol").MoveStatus

    def run(self) -> None:
        with self._sim as sim:
            robot = sim.add_robot()
            if self._hand_kg:
                _hang(sim.worldbody, self._hand_kg)
            self._server = self._server_type(robot, self._hosts())
            self._server.init()
            sim.start()
            notify({"host": self._server.hostname})
            next_s = time.monotonic()
            while not sys.stdin.closed:
                ready, _, _ = select.select([sys.stdin], [], [], max(0.0, next_s - time.monotonic()))
                if ready and not obey_next(self._act):
                    break
                if time.monotonic() < next_s:
                    continue
                # A machine that is busy makes it slow, not jerky.
                next_s = max(next_s + 1e-3, time.monotonic() - 5e-3)
                if not self._fault.frozen:
                    self._server.process_commands()
                    sim.step()
                    with contextlib.suppress(OSError):
                        self._server.send_state()
            self._server.cleanup()

    @staticmethod
    def _hosts() -> Any:
        hosts = importlib.import_module("franky_sim").LocalHostnames()
        return (host for number, host in zip(range(1, 200), hosts, strict=False) if number > 20)

    def _act(self, words: list[str]) -> dict[str, Any] | None:
        fault, verb = self._fault, words[0]
        if verb == "reflex":
            fault.error = "cartesian_reflex"
            self._server.abort(self._status.kReflexAborted)
        elif verb == "late":
            fault.error = "communication_constraints_violation"
            self._server.abort(self._status.kReflexAborted)
        elif verb in {"press", "release"}:
            fault.stopped = verb == "press"
            if fault.stopped:
                self._server.abort(self._status.kPreemptedDueToActivatedSafetyFunctions)
        elif verb == "locked":
            fault.locked, fault.error = True, "cartesian_reflex"
            self._server.abort(self._status.kReflexAborted)
        elif verb == "rate":
            fault.rate = float(words[1])
        elif verb in {"freeze", "thaw"}:
            fault.frozen = verb == "freeze"
        elif verb == "refuse":
            fault.refuse = int(words[1])
        elif verb == "end":
            fault.end()
        elif verb == "look":
            state = self._server.robot_state
            return {
                "q": list(state.q),
                "place": list(state.O_T_EE[12:15]),
                "mode": state.robot_mode.name,
                "load_kg": state.m_load,
                "load_centre_m": list(state.F_x_Cload),
            }
        else:
            raise KeyError(verb)
        return None


def _hang(world: ET.Element, kg: float) -> None:
    """Hang a hand at the flange, beside the gripper that franky-sim's robot always has."""
    flange = world.find(".//body[@name='robot0_hand']")
    if flange is None:
        raise LookupError("franky-sim's robot has no flange of the name known here")
    # The gripper's body has its origin at the flange, turned about the flange's axis.
    centre = " ".join(map(str, HAND_CENTRE_M))
    hand = ET.SubElement(flange, "body", name="tega_hand")
    ET.SubElement(hand, "inertial", pos=centre, mass=str(kg), diaginertia="0.001 0.001 0.001")


def main() -> None:
    """Run it until the standard input closes."""
    parser = argparse.ArgumentParser(description="franky-sim's robot, with faults injected.")
    parser.add_argument(
        "--hand-kg", type=float, default=0.0, help="weight of what hangs at the flange besides its gripper"
    )
    _FrankaEmulator(parser.parse_args().hand_kg).run()


if __name__ == "__main__":
    main()
