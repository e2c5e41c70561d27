"""The programs of the table of letting go, each on emulated devices, up to the moment at which the hand pushes."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, Protocol

import numpy as np

from reference.processes import begun_by, below, until
from tega.config import check_tree
from tega.hand import CLOSURE_POSES_RAD
from tega.loop import run_session
from tega.runtime.files.toml_text import tree_text
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.process import Emulator
from tega_emulators.stations import free_port, split, write_trees
from tega_emulators.vest_bench import seen_by

__all__ = ["SUBJECTS", "Started", "Subject"]

TIGHT: Final = CLOSURE_POSES_RAD[4]
_POLL_S: Final = 0.01
_TRIES: Final = 10
# Tests may themselves run under nohup, whose children ignore SIGHUP.
_FIRST: Final = (
    "import signal, sys; signal.signal(signal.SIGHUP, signal.SIG_DFL); "
    "signal.signal(signal.SIGINT, signal.default_int_handler); from tega.ui.cli.main import main; main(sys.argv[1:])"
)

_ON_TERMINAL: Final = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    "os.execvp(sys.argv[1], sys.argv[1:])"
)


@cache
def _systemd() -> list[str]:
    """Return the word that names a running systemd's manager, the system's or the user's; ``[]`` for none."""
    manager = "--system" if os.geteuid() == 0 else "--user"
    with contextlib.suppress(OSError):
        state = subprocess.run(
            ["systemctl", manager, "is-system-running"], capture_output=True, text=True, check=False
        ).stdout
        return [manager] if state.strip() in {"running", "degraded", "starting"} else []
    return []


class Program:
    """A command, on a pseudo-terminal where it is to be lost, else without one.

    With ``shell`` a shell has the terminal, as over SSH, and the command is its job; ``typed`` is typed whenever the
    program asks for Enter.
    """

    def __init__(self, *words: object, terminal: bool, shell: bool, typed: str = "") -> None:
        command = [sys.executable, "-c", _FIRST, *map(str, words)]
        # Appended to by the program and by this one, and read from its start.
        self._err = tempfile.NamedTemporaryFile("ab", buffering=0)  # noqa: SIM115  # closed with the program
        self._master, self._closing, self._unit = -1, threading.Event(), ""
        self.terminal = terminal
        if not terminal:
            none = subprocess.DEVNULL
            self.process = subprocess.Popen(
                command, stdin=none, stdout=none, stderr=self._err, start_new_session=True
            )
            return
        self._master, slave = pty.openpty()
        line = ["bash", "--norc", "--noprofile", "-i"] if shell else [*self._scope(), *command]
        line = [sys.executable, "-c", _ON_TERMINAL, *line]
        self.process = subprocess.Popen(line, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
        os.close(slave)
        if shell:
            os.write(self._master, (shlex.join(command) + "\n").encode())
        self._reader = threading.Thread(target=self._read, args=(typed,), daemon=True)
        self._reader.start()

    def _scope(self) -> list[str]:
        """Return the words that start a command in a scope like a login session's, where systemd runs."""
        if manager := _systemd():
            self._unit = f"tega-{uuid.uuid4().hex}.scope"
            return ["systemd-run", *manager, "--scope", "--quiet", "--collect", "--unit", self._unit,
                    "--property=SendSIGHUP=yes", "--property=TimeoutStopSec=20", "--"]  # fmt: skip
        return []

    def end_scope(self) -> None:
        """Have systemd end the command's scope, as at a log-out; without it, send what systemd sends."""
        if self._unit:
            subprocess.run(["systemctl", *_systemd(), "--no-block", "stop", self._unit], check=True)
            return
        # SIGTERM to every process of the control group, then SIGHUP, each followed by SIGCONT.
        top = self.process.pid
        for number in (signal.SIGTERM, signal.SIGCONT, signal.SIGHUP, signal.SIGCONT):
            for pid in [top, *below(top)]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)

    def _read(self, typed: str) -> None:
        unanswered = b""
        # A read that waits would keep the terminal open.
        with contextlib.suppress(OSError):
            while not self._closing.is_set():
                if not select.select([self._master], [], [], _POLL_S)[0]:
                    continue
                piece = os.read(self._master, 65536)
                self._err.write(piece)
                unanswered += piece
                if typed and b"Enter" in unanswered:
                    os.write(self._master, typed.encode())
                    unanswered = b""

    @property
    def pid(self) -> int:
        """Number of the command's process, behind a shell, too."""
        main = [self.process.pid, *below(self.process.pid)]
        for pid in main:
            with contextlib.suppress(OSError):
                if _FIRST.encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
                    return pid
        return self.process.pid

    def hang_up(self) -> None:
        self._closing.set()
        self._reader.join()
        os.close(self._master)
        self._master = -1

    @property
    def said(self) -> str:
        return Path(self._err.name).read_text("utf-8", "replace")

    def end(self) -> None:
        """End it and everything below it."""
        for pid in [*below(self.process.pid), self.process.pid]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()
        if self._master >= 0:
            self.hang_up()


class Started:
    """A program whose hand pushes, or whose vest vibrates; hand process and guard are below one that ``steers``.

    ``roles`` are the numbers of its processes; ``torques`` are the torque frames that the hand had received.
    """

    def __init__(
        self, program: Program, hand: Emulator | None, vest: Emulator | None = None, *, steers: bool = True
    ) -> None:
        self.program, self._hand, self._vest = program, hand, vest
        main = program.pid
        self.roles = {"run": [main], "hand process": [], "guard": []}
        if steers:
            self.roles["hand process"] = begun_by(main, "tega.devices.hand.hand_program")
            self.roles["guard"] = begun_by(main, "tega.devices.hand.hand_guard")
            assert [len(pids) for pids in self.roles.values()] == [1, 1, 1], self.roles
        self.torques = 0 if hand is None else self.check()["torques"]

    def check(self) -> dict[str, Any]:
        assert self._hand is not None
        return self._hand.say("look")

    def device_at_rest_s(self, since_s: float) -> float:
        """Return when the vest came to rest, or the fingers left the tight pose; 0 while that is not so."""
        if self._vest is not None:
            at_s, motors = seen_by(self._vest).history[-1]
            return 0.0 if any(motors) else max(float(at_s), since_s)
        check = self.check()
        opened = np.abs(np.array(check["angles_rad"]) - TIGHT).max() > 0.3
        return float(check["t_s"]) if opened else 0.0


class Begin(Protocol):
    """Starts ``tega-teleop`` with words, ended with the cell; only the one that is ``lost`` has a terminal."""

    def __call__(self, *words: object, lost: bool = True) -> Program: ...


class Subject(NamedTuple):
    """A program of the table.

    Attributes:
        steers: Whether it steers a hand itself, in a hand process with a guard.
        otherwise: Expected outcome of one that does not.
        within_s: Longest time until then, seconds.
        typed: Text to be typed, on a terminal of its own, whenever it asks for Enter.
    """

    command: str
    start: Callable[[ExitStack, Path, Begin], Started]
    steers: bool = True
    otherwise: Literal["opens", "rests"] = "rests"
    within_s: float = 0.0
    typed: str = ""

    @contextmanager
    def started(self, folder: Path, *, terminal: bool, shell: bool) -> Iterator[Started]:
        """Start it in a folder, and end everything of it afterwards."""
        with ExitStack() as stack:

            def begin(*words: object, lost: bool = True) -> Program:
                has_terminal = lost and (terminal or bool(self.typed))
                program = Program(*words, terminal=has_terminal, shell=lost and shell, typed=self.typed)
                stack.callback(program.end)
                return program

            yield self.start(stack, folder, begin)


def _lab(stack: ExitStack, folder: Path, **devices: Any) -> EmulatedLab:
    lab = stack.enter_context(emulated_lab(folder, hand=True, **devices))
    lab.go_ahead()
    # Enough for a busy machine, and less than a standstill of the table.
    lab.tree["hand"]["options"] |= {"silent_after_ms": 500.0, "lowest_rate_hz": 10.0, "reconnects": 5}
    lab.tree["safety"] = {"late_ms": 2000.0, "lowest_rate_share": 0.1, "emg_lost_ms": 600.0}
    return lab


def _written(folder: Path, tree: dict[str, Any]) -> Path:
    path = folder / "lab.toml"
    path.write_text(tree_text(tree), encoding="utf-8")
    return path


def _await_push(hand: Emulator, program: Program, *, tight: bool = True) -> None:
    """Wait until the motors push, with the fingers in the tight pose where muscles ask for that."""

    def pushes() -> bool:
        assert program.process.poll() is None, program.said
        check = hand.say("look")
        there = np.abs(np.array(check["angles_rad"]) - TIGHT).max() < 0.15
        return bool(check["servo_on"] and any(check["duties"]) and (there or not tight))

    until(pushes)


def _run(stack: ExitStack, folder: Path, begin: Begin) -> Started:
    lab = _lab(stack, folder, emg_hz=250.0)
    program = begin("run", _written(folder, lab.tree))
    _await_push(lab.hand, program)
    return Started(program, lab.hand)


def _stations(which: Literal["robot", "operator"], stack: ExitStack, folder: Path, begin: Begin) -> Started:
    lab = _lab(stack, folder, emg_hz=250.0)
    address = f"tcp/127.0.0.1:{free_port()}"
    trees = split(lab.tree, listen=address, connect=address)
    trees[0]["safety"] = lab.tree["safety"]
    robot_file, operator_file = write_trees(folder, trees)
    robot = begin("robot", robot_file, lost=which == "robot")
    if not robot.terminal:
        until(lambda: "waits for an operator" in robot.said)
    for tries_left in reversed(range(_TRIES)):
        operator = begin("operator", operator_file, lost=which == "operator")
        try:
            _await_push(lab.hand, operator)
            break
        except AssertionError:  # it ends where the robot's station is not ready
            if not tries_left:
                raise
    if which == "robot":
        return Started(robot, lab.hand)
    return Started(operator, lab.hand, steers=False)


def _play(stack: ExitStack, folder: Path, begin: Begin) -> Started:
    lab = _lab(stack, folder)
    muscles = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 60.0}}
    recording = {"dir": str(folder / "session"), "stop_free_mib": 0.0}
    tree = {"session": {"pace": "fast"}, "emg": muscles, "recording": recording}
    summary = run_session(check_tree(tree, {}, base=folder).config)
    file = folder / "session" / str(summary["recording"]["file"])
    program = begin("play", file, "--to", _written(folder, lab.tree), "--from", "2")
    _await_push(lab.hand, program, tight=False)
    return Started(program, lab.hand)


def _measure(stack: ExitStack, _folder: Path, begin: Begin) -> Started:
    hand = stack.enter_context(Emulator("allegro_port"))
    hand.go_ahead()
    there = ("--interface", hand.address["interface"], "--channel", hand.address["channel"])
    program = begin("hand", "measure", *there, "--seconds", 45)
    _await_push(hand, program, tight=False)
    return Started(program, hand)


def _calibrate(stack: ExitStack, folder: Path, begin: Begin) -> Started:
    vest = stack.enter_context(Emulator("bhaptics_player", "--port", "0"))
    tree = {"vest": {"driver": "bhaptics-player", "layout": "x40", "options": {"port": vest.address["port"]}}}
    program = begin("calibrate", _written(folder, tree), "--person", "p01", "--time-scale", "4")
    until(lambda: any(seen_by(vest).motors))
    return Started(program, None, vest, steers=False)


SUBJECTS: Final = {
    "run": Subject("tega-teleop run", _run),
    "robot": Subject("tega-teleop robot", partial(_stations, "robot")),
    "operator": Subject(
        "tega-teleop operator", partial(_stations, "operator"), steers=False, otherwise="opens", within_s=3.0
    ),
    "play": Subject("tega-teleop play --to", _play),
    "hand": Subject("tega-teleop hand measure", _measure),
    "calibrate": Subject("tega-teleop calibrate", _calibrate, steers=False, within_s=0.5, typed="\n"),
}
"""The programs, by a short name."""
