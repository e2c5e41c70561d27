"""Starts the emulated Allegro Hand in a process of its own and talks to it."""

from __future__ import annotations

import json
import subprocess
import sys
from types import TracebackType
from typing import Any, Self

__all__ = ["AllegroProcess"]


class AllegroProcess:
    """The emulated hand behind a serial CAN adapter.

    Example::

        with AllegroProcess() as hand, Allegro(AllegroOptions(**hand.options)) as driver:
            driver.step(3)
            hand.command("silence")

    Args:
        arguments: Options of :mod:`tega.testing.emulators.allegro_port`, such as ``"--side", "left"``.

    Attributes:
        options: Settings of the ``allegro`` driver that reach it.
    """

    def __init__(self, *arguments: str) -> None:
        """Store the options; nothing is started yet."""
        self._arguments = arguments
        self._process: subprocess.Popen[str] | None = None
        self.options: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Start it."""
        words = [sys.executable, "-m", "tega.testing.emulators.allegro_port", *self._arguments]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        channel = self._hear()["channel"]
        self.options = {"interface": "slcan", "channel": channel, "bus": {"sleep_after_open": 0.0}}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it; the adapter is gone then."""
        self.unplug()

    def command(self, words: str = "look") -> dict[str, Any]:
        """Switch a fault on, ``clear`` them, or ``look``.

        Returns:
            ``servo_on``, ``over`` (torque frames beyond ``limit``), ``duties`` (16), ``angles_rad`` (16)
            and ``reports`` (whether it sends positions).
        """
        if self._process is None or self._process.stdin is None:
            raise RuntimeError("the emulated hand is not running")
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()
        return self._hear()

    def unplug(self) -> None:
        """Take hand and adapter away."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()

    def _hear(self) -> dict[str, Any]:
        if self._process is None or self._process.stdout is None:
            raise RuntimeError("the emulated hand is not running")
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the emulated hand has ended")
        said: dict[str, Any] = json.loads(line)
        return said
