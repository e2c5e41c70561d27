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
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Literal, Self

from tega.calibration import Calibration, EmgMaxima, FingerMaxima, TouchMaxima, save_calibration
from tega.errors import DeviceUnavailableError

__all__ = ["Program", "free_port", "write_stations"]

_PATIENCE_S = 60.0
_ARM = """
[arm]
driver = "simulated-arm"
mapping = { frame = "base" }
"""
_ROBOT = """# The robot's station, all of it simulated. In one terminal:  tega-teleop robot {robot}
# and in another:                                             tega-teleop operator {operator}

[net]
station = "robot"
name = "robot"
listen = "{listen}"
{robot_keys}
[tactile.thumb]
driver = "synthetic-touch"
options = {{ seed = 1, duration_s = {duration_s} }}

[hand]
driver = "python-can"
options = {{ interface = "virtual", channel = "tega" }}
{arm}"""
_OPERATOR = """# The operator's station, all of it simulated; the robot's stands in {robot}.

[net]
station = "operator"
name = "operator"
robot = "robot"
connect = "{connect}"
{operator_keys}
[calibration]
file = "calibration.toml"

[emg]
driver = "synthetic-emg"
kind = "raw"
options = {{ seed = 1, duration_s = {duration_s} }}
"""


def free_port() -> int:
    """Return a TCP port of this machine that nobody uses now."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
    return port


def write_stations(
    folder: Path,
    *,
    port: int,
    connect_port: int | None = None,
    keys: Path | None = None,
    arm: bool = False,
    duration_s: float = 60.0,
) -> tuple[Path, Path]:
    """Write settings of two simulated stations, with a calibration made up for them.

    Args:
        folder: For the files.
        port: Where the robot listens.
        connect_port: Where the operator connects to, if something stands between.
        keys: Folder that ``tega-teleop net keys`` has made for ``operator`` and ``robot``; none for none.
        arm: Whether the robot has a simulated arm.
        duration_s: How long the simulated grasp lasts.

    Returns:
        The files of robot and operator.
    """
    scheme = "tcp" if keys is None else "tls"
    robot, operator = folder / "robot.toml", folder / "operator.toml"
    names = {
        "robot": robot.name,
        "operator": operator.name,
        "listen": f"{scheme}/127.0.0.1:{port}",
        "connect": f"{scheme}/127.0.0.1:{connect_port or port}",
        "robot_keys": f'keys = "{keys / "robot"}"\noperators = ["operator"]\n' if keys else "",
        "operator_keys": f'keys = "{keys / "operator"}"\n' if keys else "",
        "arm": _ARM if arm else "",
        "duration_s": duration_s,
    }
    robot.write_text(_ROBOT.format(**names), encoding="utf-8")
    operator.write_text(_OPERATOR.format(**names), encoding="utf-8")
    full = TouchMaxima(cci_max=1.0, eda_max=10_000.0)
    maxima = EmgMaxima(
        kind="raw", rate_hz=1000.0, tau=100, channels=("ch1", "ch2", "ch3"), maxima=(200.0, 200.0, 200.0)
    )
    calibration = Calibration(
        preset="live",
        origin="made up for the simulated stations",
        tactile=FingerMaxima(thumb=full, index=full),
        emg=maxima,
    )
    save_calibration(calibration, folder / "calibration.toml")
    return robot, operator


class Program:
    """A station as a program; it ends with the block, whatever happens.

    Args:
        verb: Which station.
        settings: Its settings file.
        words: Further words of its command line.

    Attributes:
        process: The program.
    """

    process: subprocess.Popen[str]

    def __init__(self, verb: Literal["operator", "robot"], settings: Path, *words: str) -> None:
        self._words = [sys.executable, "-m", "tega.cli", verb, str(settings), "--json", *words]
        self._out: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115  # closed on exit
        self._err: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115

    def __enter__(self) -> Self:
        """Start it."""
        self.process = subprocess.Popen(
            self._words, stdin=subprocess.DEVNULL, stdout=self._out, stderr=self._err, text=True
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, by force if it does not by itself."""
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._out.close()
        self._err.close()

    @property
    def said(self) -> str:
        """What it has said on its error output."""
        self._err.seek(0)
        return self._err.read()

    def await_said(self, text: str, *, times: int = 1, patience_s: float = _PATIENCE_S) -> None:
        """Wait until it has said something so often.

        Raises:
            DeviceUnavailableError: It has not, or has ended before.
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
