"""Two stations on this machine, each a program of its own, started as a person would.

Example::

    with Program("robot", robot_toml) as robot, Program("operator", operator_toml) as operator:
        robot.await_said("leads")
        summary = operator.end()
"""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import IO, Any, Literal, Self

from tega.config.calibration import Calibration, EmgMaxima, TouchMaxima, save_calibration
from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import end_child, python_command, python_environment
from tega.runtime.files.toml_text import tree_text

__all__ = ["Program", "free_port", "split", "write_stations", "write_trees"]

_PATIENCE_S = 60.0
_LEAVE_S = 10.0
_ROBOT_S = ("tactile", "hand", "arm", "recording")


def free_port() -> int:
    """Return a TCP port of this machine that nobody uses now."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
    return port


def split(
    tree: dict[str, Any], *, listen: str, connect: str, keys: Path | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Share the settings of one machine among two stations, the robot's and the operator's.

    The operator connects to ``connect``: the same as ``listen``, unless something stands between. ``keys`` is
    the folder that ``tega-teleop net keys`` has made for ``operator`` and ``robot``.
    """
    robot: dict[str, Any] = {"net": {"station": "robot", "name": "robot", "listen": listen}}
    operator: dict[str, Any] = {
        "net": {"station": "operator", "name": "operator", "robot": "robot", "connect": connect}
    }
    if keys is not None:
        robot["net"] |= {"keys": str(keys / "robot"), "operators": ["operator"]}
        operator["net"]["keys"] = str(keys / "operator")
    for name, station in (("robot", robot), ("operator", operator)):
        if "session" in tree:
            station["session"] = session = dict(tree["session"])
            if "out_dir" in session:  # on one machine they may share a folder, but not this one
                session["out_dir"] = f"{session['out_dir']}-{name}"
    robot |= {key: tree[key] for key in _ROBOT_S if key in tree}
    operator |= {key: value for key, value in tree.items() if key not in {*_ROBOT_S, "session"}}
    if (tracker := robot.get("arm", {}).get("tracker")) is not None:
        robot["arm"] = {key: value for key, value in robot["arm"].items() if key != "tracker"}
        operator["net"]["tracker"] = tracker
    return robot, operator


def write_stations(
    folder: Path,
    *,
    port: int,
    connect_port: int | None = None,
    keys: Path | None = None,
    duration_s: float = 60.0,
) -> tuple[Path, Path]:
    """Write settings, robot's and operator's, of two simulated stations, with a calibration made up for them.

    The robot listens at ``port``; the operator connects to ``connect_port``, if something stands between.
    ``keys`` is as of :func:`split`; ``duration_s`` is how long the simulated grasp lasts.
    """
    touch = {"driver": "synthetic-touch", "options": {"seed": 1, "duration_s": duration_s}}
    tree = {
        "calibration": {"file": "calibration.toml"},
        "tactile": {"thumb": touch},
        "hand": {"driver": "python-can", "options": {"interface": "virtual", "channel": "tega"}},
        "emg": {
            "driver": "synthetic-emg",
            "kind": "raw",
            "options": {"seed": 1, "duration_s": duration_s},
        },
    }
    scheme = "tcp" if keys is None else "tls"
    listen, connect = (f"{scheme}/127.0.0.1:{p}" for p in (port, connect_port or port))
    full = TouchMaxima(cci_max=1.0, eda_max=10_000.0)
    maxima = EmgMaxima(
        kind="raw", rate_hz=1000.0, tau=100, channels=("ch1", "ch2", "ch3"), maxima=(200.0, 200.0, 200.0)
    )
    calibration = Calibration(
        preset="live",
        origin="made up for the simulated stations",
        tactile={"thumb": full, "index": full},
        emg=maxima,
    )
    save_calibration(calibration, folder / "calibration.toml")
    return write_trees(folder, split(tree, listen=listen, connect=connect, keys=keys))


def write_trees(
    folder: Path, trees: tuple[dict[str, Any], dict[str, Any]], stem: str = ""
) -> tuple[Path, Path]:
    """Write the settings of robot and operator, and return the files."""
    robot, operator = folder / f"{stem}robot.toml", folder / f"{stem}operator.toml"
    for file, tree in zip((robot, operator), trees, strict=True):
        file.write_text(tree_text(tree), encoding="utf-8")
    return robot, operator


class Program:
    """A station as a program; it ends with the block, whatever happens."""

    process: subprocess.Popen[str]

    def __init__(self, verb: Literal["operator", "robot"], settings: Path, *words: str) -> None:
        self._words = python_command("tega.ui.cli", verb, str(settings), "--json", *words)
        self._out: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115  # closed on exit
        self._err: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115

    def __enter__(self) -> Self:
        """Start it."""
        self.process = subprocess.Popen(
            self._words,
            stdin=subprocess.DEVNULL,
            stdout=self._out,
            stderr=self._err,
            text=True,
            env=python_environment(),
        )
        return self

    def __exit__(self, *_error: object) -> None:
        """End it, by force if it does not by itself."""
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        end_child(self.process, _LEAVE_S)
        self._out.close()
        self._err.close()

    @property
    def said(self) -> str:
        """What it has printed on its error output."""
        self._err.seek(0)
        return self._err.read()

    def await_said(self, text: str, *, times: int = 1, patience_s: float = _PATIENCE_S) -> None:
        """Wait until it has printed a text so often.

        If it has not in time, or ends before, :class:`DeviceUnavailableError` is raised.
        """
        until_s = time.monotonic() + patience_s
        while self.said.count(text) < times:
            if self.process.poll() is not None or time.monotonic() > until_s:
                raise DeviceUnavailableError(f"it has not said {text!r}, but: {self.said!r}")
            time.sleep(0.02)

    def end(self) -> dict[str, Any]:
        """Have it end, and return its summary."""
        self.process.terminate()
        self.process.wait(_PATIENCE_S)
        self._out.seek(0)
        summary: dict[str, Any] = json.loads(self._out.read())
        return summary
