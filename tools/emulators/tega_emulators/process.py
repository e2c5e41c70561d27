"""Start an emulator as a program of its own, and talk to it.

Each is written from the device's published bytes alone: it imports neither ``tega.wire`` nor the extension, so that a
mistake there cannot hide itself. It takes faults while it runs, and answers every line; see
:mod:`tega_emulators.pipe`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Self

from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.child_process import end_child, python_command, python_environment

__all__ = ["Emulator", "first_of_all"]

_LEAVE_S = 5.0
# Above every thread of a run.
_PRIORITY = 20


def first_of_all(thread: int) -> bool:
    """Let a thread, by its system number, go before every thread of a run; return if that is allowed."""
    if sys.platform != "linux":
        return False
    try:
        os.sched_setscheduler(thread, os.SCHED_RR, os.sched_param(_PRIORITY))
    except OSError:  # not allowed
        return False
    return True


class Emulator:
    """An emulator that runs for as long as the ``with`` block, and not longer than this process.

    ``module`` is its name in :mod:`tega_emulators`, such as ``cyton``, or any module's full name. ``address``
    is where it can be reached, such as ``{"port": "/dev/pts/3"}``; a device that was plugged in again may be
    somewhere else.

    Example::

        with Emulator("cyton", "--signal", "emg") as board, Cyton(CytonOptions(**board.address)) as source:
            board.say("loss 0.1")
    """

    def __init__(self, module: str, *arguments: str) -> None:
        """Store the options; nothing is started yet."""
        self._module = module if "." in module else f"tega_emulators.{module}"
        self._arguments = arguments
        self._process: subprocess.Popen[str] | None = None
        self._saying = threading.Lock()
        self.address: dict[str, Any] = {}

    @property
    def port(self) -> Any:
        """The ``port`` of its address."""
        return self.address["port"]

    @property
    def pid(self) -> int:
        """The process's number; 0 while it does not run."""
        return 0 if self._process is None else self._process.pid

    def __enter__(self) -> Self:
        """Start it and wait until it can be reached."""
        command = python_command(self._module, *self._arguments)
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="ascii",
            env=python_environment(),
            process_group=0,  # Ctrl-C is for who started it, who then ends it
        )
        self.address = self._receive()
        return self

    def __exit__(self, *_error: object) -> None:
        """End it."""
        process, self._process = self._process, None
        if process is None:
            return
        end_child(process, _LEAVE_S)
        if process.stdout is not None:
            process.stdout.close()

    def say(self, line: str) -> dict[str, Any]:
        """Give it a command, wait until it is carried out, and return the answer.

        An unknown command raises :class:`InvalidValueError`, an ended emulator
        :class:`DeviceUnavailableError`.
        """
        if self._process is None or self._process.stdin is None:
            raise DeviceUnavailableError(f"{self._module} does not run", "use it in a with block")
        with self._saying:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            answer = self._receive()
        if "error" in answer:
            raise InvalidValueError(f"{self._module}: {answer['error']}")
        self.address |= {key: answer[key] for key in self.address.keys() & answer.keys()}
        return answer

    def go_ahead(self) -> bool:
        """Let it go before every thread of a run; return whether the system allows that.

        A device has a processor of its own: it answers when it is ready, however busy this machine is. What an emulator
        takes then, it takes from the run.
        """
        if self._process is None or sys.platform != "linux":
            return False
        threads = Path(f"/proc/{self._process.pid}/task").iterdir()
        return all(first_of_all(int(thread.name)) for thread in threads)

    def kill(self) -> None:
        """End it without a word, as a cable that is pulled."""
        if self._process is not None:
            self._process.kill()
        self.__exit__()

    def _receive(self) -> dict[str, Any]:
        process = self._process
        line = "" if process is None or process.stdout is None else process.stdout.readline()
        if not line:
            self.__exit__()
            raise DeviceUnavailableError(f"{self._module} has ended", "its error output says why")
        message: dict[str, Any] = json.loads(line)
        return message
