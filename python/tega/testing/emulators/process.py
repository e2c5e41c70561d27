"""Start an emulator as a program of its own, and talk to it.

Each is written from the device's published bytes alone: it imports neither ``tega.wire`` nor the extension, so that a
mistake there cannot hide itself. It says where it can be reached through ``--port-file`` and takes faults while it
runs, line by line on its standard input (``loss 0.1``), those behind a serial port by command line as well
(``--fault loss=0.1``); every line is answered on standard output by ``ok`` or ``?``.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Self

__all__ = ["Emulator"]

_START_S = 30.0


class Emulator:
    """An emulator that runs for as long as the ``with`` block.

    Args:
        module: Its name in :mod:`tega.testing.emulators`, such as ``cyton``, or any module's full name.
        arguments: For its command line; ``--port-file`` is added.

    Example::

        with Emulator("cyton", "--signal", "emg") as board, Cyton(CytonOptions(port=board.port)) as source:
            board.say("loss 0.1")
    """

    def __init__(self, module: str, *arguments: str) -> None:
        self._module = module if "." in module else f"tega.testing.emulators.{module}"
        self._arguments = arguments
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[str] | None = None

    @property
    def port(self) -> str:
        """Where it can be reached now; a device that was plugged in again may be somewhere else."""
        return self._port_file().read_text()

    def say(self, line: str) -> str:
        """Give it a line of its standard input, wait until it is obeyed, and return the answer.

        Raises:
            ValueError: It does not know what that means.
            RuntimeError: It has ended.
        """
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise RuntimeError(f"{self._module} does not run")
        process.stdin.write(line + "\n")
        process.stdin.flush()
        answer = process.stdout.readline().rstrip("\n")
        if answer.startswith("?"):
            raise ValueError(answer)
        if not answer.startswith("ok"):
            raise RuntimeError(f"{self._module} ended with {process.wait()}")
        return answer.removeprefix("ok").strip()

    def __enter__(self) -> Self:
        """Start it and wait until it can be reached."""
        self._folder = tempfile.TemporaryDirectory(prefix="tega-emulator-")
        command = [
            sys.executable,
            "-m",
            self._module,
            "--port-file",
            str(self._port_file()),
            *self._arguments,
        ]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="ascii"
        )
        deadline = time.monotonic() + _START_S
        while not self._port_file().exists():
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.__exit__(None, None, None)
                raise RuntimeError(f"{self._module} did not start")
            time.sleep(0.01)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        if (process := self._process) is not None:
            if process.stdin is not None:
                process.stdin.close()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdout is not None:
                process.stdout.close()
        if self._folder is not None:
            self._folder.cleanup()
        self._process = self._folder = None

    def _port_file(self) -> Path:
        if self._folder is None:
            raise RuntimeError(f"{self._module} does not run")
        return Path(self._folder.name) / "port"
