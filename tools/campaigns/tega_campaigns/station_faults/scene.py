"""Two stations on emulated devices, what stands between them, and what they tell."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tega.child_process import end_child, python_command, python_environment
from tega.errors import DeviceUnavailableError, TegaError
from tega.every import every
from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.lossy_wire import LossyWire
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.stations import free_port, split, write_trees

__all__ = ["SECOND", "StationScene", "WatchedStation", "until"]

SECOND = "bob"
"""Name of an operator besides the one who leads, who is called ``operator``."""

_PATIENCE_S = 60.0
_LEAVE_S = 10.0
_DEAD_MAN, _CLUTCH, _RECOVER = 0, 1, 2
_PATH_S = 600
_PRESS_S = 2.0

Told = dict[str, Any]


def until(what: Callable[[], bool], *, patience_s: float = _PATIENCE_S) -> bool:
    """Wait until something is so; return whether it came to be."""
    end_s = time.monotonic() + patience_s
    while not what():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.01)
    return True


class WatchedStation:
    """A station as a program that tells what it does, see :mod:`tega_campaigns.watched`.

    Args:
        settings: Its file.
        words: Further words of its command line.
        before: Words in front of the command, such as those that run it in another network namespace.

    Attributes:
        told: All that it has told, oldest first.
        process: The program.
    """

    process: subprocess.Popen[str]

    def __init__(self, settings: Path, *words: str, before: Sequence[str] = ()) -> None:
        self._command = [*before, *python_command("tega_campaigns.watched", str(settings), *words)]
        self.told: list[Told] = []

    def __enter__(self) -> Self:
        """Start it."""
        self.process = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
            env=python_environment(),
        )
        self._thread = threading.Thread(target=self._read, name="tega-watch", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, by force if it does not by itself."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        end_child(self.process, _LEAVE_S)
        self._hang_up()

    def _hang_up(self) -> None:
        self._thread.join(5)
        if self.process.stdout is not None:
            self.process.stdout.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.told.append(json.loads(line))

    @property
    def now(self) -> Told:
        """What it does, as last told."""
        return next((one for one in reversed(self.told) if "state" in one), {})

    def since(self, t_s: float, key: str) -> list[tuple[float, Any]]:
        """Return what one thing became after a time, and when; what it was before stands first, at that time."""
        changes: list[tuple[float, Any]] = []
        for one in list(self.told):
            if key not in one:
                continue
            if one["t_s"] <= t_s:
                changes = [(t_s, one[key])]
            elif not changes or changes[-1][1] != one[key]:
                changes.append((one["t_s"], one[key]))
        return changes

    def has_said(self, words: str, since_s: float = 0.0) -> float | None:
        """Return when it has said something after a time; ``None`` if it has not."""
        return next(
            (one["t_s"] for one in list(self.told) if one["t_s"] >= since_s and words in one.get("said", "")),
            None,
        )

    def follow(self, other: WatchedStation) -> None:
        """Go on as a program that was started in the place of this one; what this one has told stays."""
        before = self.told
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(5)
        self._hang_up()
        self.process, self._thread = other.process, other._thread
        other.told[:0] = before
        self.told = other.told

    def freeze(self) -> None:
        """Let it stand still, as a machine that hangs."""
        os.kill(self.process.pid, signal.SIGSTOP)

    def go_on(self) -> None:
        """Let it run again."""
        os.kill(self.process.pid, signal.SIGCONT)

    def kill(self) -> None:
        """End it without a word."""
        self.process.kill()
        self.process.wait()


class StationScene:
    """An operator who leads a robot with hand and arm and feels a fingertip; ends with the block.

    Args:
        folder: For settings and calibration.
        net: Further settings of ``[net]`` for both.
        keys: Folder of keys; none for none.
        wire: Instead of a proxy, with the operator at its other end; needs keys.

    Attributes:
        folder: Where their files are.
        keys: Folder of keys; ``None`` for none.
        link: What stands between them.
        robot: The robot's station.
        operator: The operator's.
        lab: Their devices.
        refused_s: How long after it began another operator's program was told no; ``None`` for never.
    """

    refused_s: float | None = None
    link: ImpairedLink
    robot: WatchedStation
    operator: WatchedStation
    lab: EmulatedLab

    def __init__(
        self,
        folder: Path,
        *,
        net: dict[str, Any] | None = None,
        keys: Path | None = None,
        wire: LossyWire | None = None,
    ) -> None:
        self.folder, self._net, self.keys, self.wire = folder, net or {}, keys, wire
        self._stack = ExitStack()
        self._held: set[int] = set()

    def __enter__(self) -> Self:
        """Start everything and let the operator take the lead and hold of the arm.

        Raises:
            DeviceUnavailableError: They do not come together.
        """
        with ExitStack() as stack:
            folder, port = self.folder, free_port()
            lab = stack.enter_context(emulated_lab(folder, emg_hz=250.0, fingers=("thumb",), arm=True))
            self.lab = lab
            self.link = stack.enter_context(ImpairedLink(port))
            tree = lab.tree
            tree["hand"] = {"driver": "python-can", "options": {"interface": "virtual", "channel": "tega"}}
            tree["arm"]["tracker"] = {"driver": "poses-file", "options": {"file": str(_still(folder))}}
            # A button of which nothing is heard for ten seconds is not believed.
            stack.enter_context(every(self._hold_on, every_s=_PRESS_S, name="tega-person"))
            self._tree, self._port = tree, port
            self._robot_file, self._operator_file = self.files("", keys=self.keys)
            self.robot = self.start_robot()
            stack.callback(lambda: self.robot.__exit__(None, None, None))
            if not until(lambda: self.robot.has_said("waits for an operator") is not None):
                raise DeviceUnavailableError("the robot's station has not started", str(self.robot.told[-3:]))
            self.operator = self.start_operator()
            stack.callback(lambda: self.operator.__exit__(None, None, None))
            self.take_hold()
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End everything."""
        self._stack.close()

    def files(self, stem: str, *, keys: Path | None, name: str = "operator") -> tuple[Path, Path]:
        """Write the settings of the robot's station, and of an operator's of some name."""
        place = f"{'tcp' if keys is None else 'tls'}/{'127.0.0.1' if self.wire is None else self.wire.here}"
        port = self.link.port if self.wire is None else self._port
        listen, connect = f"{place}:{self._port}", f"{place}:{port}"
        trees = split(self._tree, listen=listen, connect=connect, keys=keys)
        for tree in trees:
            tree["net"] |= self._net
        trees[1]["net"]["name"] = name
        if keys is not None:
            trees[0]["net"]["operators"] = ["operator", SECOND]
            trees[1]["net"]["keys"] = str(keys / name)
        return write_trees(self.folder, trees, stem)

    def start_robot(self) -> WatchedStation:
        """Start the robot's station."""
        return WatchedStation(self._robot_file).__enter__()

    def start_operator(self, settings: Path | None = None) -> WatchedStation:
        """Start an operator's station, with the one SpaceMouse that is there."""
        before = () if self.wire is None else self.wire.inside
        cap = str(self.lab.cap.port)
        return WatchedStation(settings or self._operator_file, "--cap", cap, before=before).__enter__()

    def ready(self) -> bool:
        """Whether muscles steer the hand and touch is felt."""
        return (
            self.robot.now.get("state") == "active"
            and self.operator.now.get("state") == "active"
            and bool(self.operator.now.get("felt"))
        )

    def steers(self) -> bool:
        """Whether the operator steers hand and arm and feels touch."""
        return self.ready() and self._arm("following")

    def take_hold(self) -> None:
        """Have the arm follow, however it is."""
        for _ in range(10):
            self.lift(_DEAD_MAN, _CLUTCH)
            self.press(_RECOVER)
            time.sleep(0.1)
            self.lift(_RECOVER)
            self.press(_DEAD_MAN)  # without it a run that leads an arm is not active
            if not until(lambda: self.ready() and self._arm("idle: the clutch is open"), patience_s=10.0):
                continue
            self.press(_CLUTCH)
            if until(lambda: self._arm("following"), patience_s=3.0):
                return
        raise DeviceUnavailableError(
            "the stations do not come together", f"{self.robot.told[-2:]} {self.operator.told[-2:]}"
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
