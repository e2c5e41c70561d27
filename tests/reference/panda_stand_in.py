"""What of panda-python the driver ``panda`` calls, on a point that goes to its target: a stand-in, not the library.

It follows the library's source where that matters: an error of the control thread is raised once, a controller that has
started clears a reflex by itself, and stopping waits. ``tests/tega/unit/test_arm_panda.py`` holds its names against the
wheel.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np

__all__ = ["CartesianImpedance", "IncompatibleVersionError", "Panda", "library"]


class IncompatibleVersionError(RuntimeError):
    """The robot is of another version."""

    def __init__(self, server_version: int, library_version: int) -> None:
        super().__init__(f"{server_version} is not {library_version}")
        self.server_version, self.library_version = server_version, library_version


class CartesianImpedance:
    """Takes targets."""

    def __init__(self, impedance: Any, **how: float) -> None:
        assert set(how) == {"damping_ratio", "nullspace_stiffness", "filter_coeff"}
        self.impedance = impedance
        self.asked: list[np.ndarray] = []

    def set_control(self, position: Any, orientation: Any, q_nullspace: Any) -> None:
        assert np.shape(orientation) == (4,)
        assert np.shape(q_nullspace) == (7,)
        self.asked.append(np.array(position))


class Panda:
    """A robot whose hand is where it was last asked to be, a tenth of the way a look."""

    refused: IncompatibleVersionError | None = None
    newest: Panda

    def __init__(self, hostname: str, realtime_config: str) -> None:
        self.where = (hostname, realtime_config)
        if self.refused is not None:
            raise self.refused
        Panda.newest = self
        self.place, self.mode, self.errors, self.raised = np.array([0.5, 0.0, 0.3]), "kIdle", "", ""
        self.controller: CartesianImpedance | None = None
        self.started = self.recovered = 0
        self.thresholds: tuple[Any, ...] = ()

    def get_robot(self) -> Any:
        def behave(*thresholds: Any) -> None:
            self.thresholds = thresholds

        return SimpleNamespace(set_collision_behavior=behave)

    def get_state(self) -> Any:
        if self.controller is not None and self.controller.asked and not self.errors:
            self.place = self.place + 0.1 * (self.controller.asked[-1] - self.place)
        pose = np.eye(4)
        pose[:3, 3] = self.place
        return SimpleNamespace(
            O_T_EE=pose.ravel(order="F").tolist(),
            time=SimpleNamespace(to_msec=lambda: time.monotonic_ns() // 1_000_000),
            control_command_success_rate=1.0,
            robot_mode=f"RobotMode.{self.mode}",
            current_errors=self.errors,
            q=[0.0] * 7,
        )

    def start_controller(self, controller: CartesianImpedance) -> None:
        self.recover()
        self.started += 1
        self.controller, self.mode = controller, "kMove"

    def stop_controller(self) -> None:
        time.sleep(0.02)
        self.controller = None
        self.mode = "kIdle" if self.mode == "kMove" else self.mode

    def recover(self) -> None:
        self.recovered += 1
        if self.mode == "kReflex":
            self.mode, self.errors = "kIdle", ""

    def raise_error(self) -> None:
        said, self.raised = self.raised, ""
        if said:
            raise RuntimeError(said)

    def touch(self) -> None:
        """End the motion as a reflex does."""
        self.mode, self.errors, self.raised = "kReflex", "[cartesian_reflex]", "libfranka: cartesian_reflex"


def library() -> dict[str, Any]:
    """Return its modules by name."""
    configs = SimpleNamespace(kIgnore="ignore", kEnforce="enforce")
    top = SimpleNamespace(
        Panda=Panda, IncompatibleVersionError=IncompatibleVersionError, __version__="of a stand-in"
    )
    return {
        "panda_py": top,
        "panda_py.controllers": SimpleNamespace(CartesianImpedance=CartesianImpedance),
        "panda_py.libfranka": SimpleNamespace(RealtimeConfig=configs),
    }
