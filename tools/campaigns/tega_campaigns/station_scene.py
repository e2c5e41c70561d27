"""Two stations on emulated devices, what stands between them, and what they report."""

from __future__ import annotations

import contextlib
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from tega.errors import DeviceUnavailableError, TegaError
from tega.runtime.clock import every
from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.runner import until
from tega_campaigns.supervisor import Supervisor
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.stations import free_port, split, write_trees

__all__ = ["StationScene"]

_PATIENCE_S = 60.0
_DEAD_MAN, _CLUTCH, _RECOVER = 0, 1, 2
_PATH_S = 600
_PRESS_S = 2.0


class StationScene:
    """An operator who leads a robot with hand and arm and feels a fingertip; ends with the block.

    ``folder`` is for settings and calibration, ``net`` are further settings of ``[net]`` for both. ``link``
    is between the two stations, ``lab`` are their devices.
    """

    link: ImpairedLink
    robot: Supervisor
    operator: Supervisor
    lab: EmulatedLab

    def __init__(self, folder: Path, *, net: dict[str, Any] | None = None) -> None:
        self._folder, self._net = folder, net or {}
        self._stack = ExitStack()
        self._held: set[int] = set()

    def __enter__(self) -> Self:
        """Start everything and let the operator take the lead and hold of the arm."""
        with ExitStack() as stack:
            folder, port = self._folder, free_port()
            lab = stack.enter_context(emulated_lab(folder, emg_hz=250.0, fingers=("thumb",), arm=True))
            self.lab = lab
            self.link = stack.enter_context(ImpairedLink(port))
            tree = lab.tree
            tree["hand"] = {"driver": "python-can", "options": {"interface": "virtual", "channel": "tega"}}
            tree["arm"]["tracker"] = {"driver": "poses-file", "options": {"file": str(_still(folder))}}
            # A button that sent nothing for ten seconds is not believed.
            stack.enter_context(every(self._hold_on, every_s=_PRESS_S))
            listen, connect = (f"tcp/127.0.0.1:{number}" for number in (port, self.link.port))
            trees = split(tree, listen=listen, connect=connect)
            for station in trees:
                station["net"] |= self._net
            robot_file, operator_file = write_trees(folder, trees)
            self.robot = stack.enter_context(Supervisor(robot_file, "--commands"))
            self.robot.start()
            if until(lambda: self.robot.has_said("waits for an operator") is not None, _PATIENCE_S) is None:
                raise DeviceUnavailableError(
                    "the robot's station has not started", str(self.robot.lines[-3:])
                )
            self.operator = stack.enter_context(Supervisor(operator_file, "--cap", str(lab.cap.port)))
            self.operator.start()
            self.take_hold()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_error: object) -> None:
        """End everything."""
        self._stack.close()

    def ready(self) -> bool:
        """Whether muscles steer the hand and touch is felt."""
        return (
            self.robot.now.get("state") == "active"
            and self.operator.now.get("state") == "active"
            and bool(self.operator.now.get("felt"))
        )

    def take_hold(self) -> None:
        """Have the arm follow, however it is."""
        for _ in range(10):
            self.lift(_DEAD_MAN, _CLUTCH)
            self.press(_RECOVER)
            time.sleep(0.1)
            self.lift(_RECOVER)
            self.press(_DEAD_MAN)  # without it a run that leads an arm is not active
            if until(lambda: self.ready() and self._arm("idle: the clutch is open"), 10.0) is None:
                continue
            self.press(_CLUTCH)
            if until(lambda: self.robot.leads, 3.0) is not None:
                return
        raise DeviceUnavailableError(
            "the stations do not come together", f"{self.robot.lines[-2:]} {self.operator.lines[-2:]}"
        )

    def _arm(self, words: str) -> bool:
        return str(self.robot.now.get("arm", "")).startswith(words)

    def press(self, *buttons: int) -> None:
        """Press buttons of the SpaceMouse: dead-man, clutch, recover."""
        for button in buttons:
            self._held.add(button)
            self.lab.cap.say(f"press {button}")

    def lift(self, *buttons: int) -> None:
        """Let go of them."""
        for button in buttons:
            self._held.discard(button)
            self.lab.cap.say(f"lift {button}")

    def _hold_on(self) -> None:
        """Press what is held once more."""
        for button in tuple(self._held):
            with contextlib.suppress(TegaError):  # the emulator has ended
                self.lab.cap.say(f"press {button}")


def _still(folder: Path) -> Path:
    """Write the path of a forearm that keeps still."""
    file = folder / "forearm.csv"
    rows = [f"{k / 60:.4f},0.2,-0.3,-0.4,0,0,0,1" for k in range(60 * _PATH_S)]
    file.write_text("\n".join(["t_s,x_m,y_m,z_m,qx,qy,qz,qw", *rows, ""]), encoding="ascii")
    return file
