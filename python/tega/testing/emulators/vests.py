"""Starts an emulated vest in a process of its own, switches its faults, and asks what its motors did.

Example::

    with EmulatedVest("bhaptics_player") as peer, PlayerVest(PlayerOptions(port=peer.address["port"])) as vest:
        vest.write(0, frame)
        peer.fault("freeze")
        print(peer.report().history)
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Literal, Self

import msgspec

from tega.errors import DeviceUnavailableError, InvalidValueError

__all__ = ["EmulatedVest", "VestReport"]

_FREE = {"bhaptics_player": ("--port", "0"), "bluez_vest": (), "hid_bridge": ()}


class VestReport(msgspec.Struct, frozen=True, kw_only=True):
    """What an emulated vest saw.

    Attributes:
        motors: What its 40 motors do now, 0 to 100, in the wearer's order.
        history: Every change with its time in seconds on the machine's monotonic clock.
        over: How often a motor was driven above what was given to :meth:`EmulatedVest.limit`.
        errors: What it was sent and should not have been.
        received: Messages received.
        connections: Connections it has taken.
        modules: The modules of this package that its process has imported.
    """

    motors: list[int]
    history: list[tuple[float, list[int]]]
    over: int
    errors: list[str]
    received: int
    connections: int
    modules: list[str]


class EmulatedVest:
    """An emulator as a child process; it ends with the ``with`` block, or with this process.

    Args:
        which: The emulator; it picks a free address.
        arguments: Further words of its command line.
        environ: Variables to add to its environment.
    """

    def __init__(
        self,
        which: Literal["bhaptics_player", "bluez_vest", "hid_bridge"],
        arguments: tuple[str, ...] = (),
        environ: Mapping[str, str] | None = None,
    ) -> None:
        self._command = [sys.executable, "-m", f"tega.testing.emulators.{which}", *_FREE[which], *arguments]
        self._environ = {**os.environ, **(environ or {})}
        self._process: subprocess.Popen[str] | None = None
        self.address: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Start it and wait until it listens."""
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=self._environ
        )
        self.address = self._hear()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        process, self._process = self._process, None
        if process is not None:
            process.communicate()

    def fault(self, name: str) -> None:
        """Switch a fault on and every other one off; ``""`` for none.

        Raises:
            InvalidValueError: This emulator has no such fault.
        """
        self._ask({"fault": name})

    def limit(self, percent: int, *, heat_share: float) -> None:
        """Say what no motor is to be driven above, and how warm none may get; what is above is counted."""
        self._ask({"limit": percent, "heat": heat_share})

    def report(self) -> VestReport:
        """Ask what it saw."""
        return msgspec.convert(self._ask({"report": True}), VestReport)

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        if self._process is None or self._process.stdin is None:
            raise DeviceUnavailableError("the emulator is not running", "use it in a with block")
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return self._hear()

    def _hear(self) -> dict[str, Any]:
        line = (
            "" if self._process is None or self._process.stdout is None else self._process.stdout.readline()
        )
        if not line:
            raise DeviceUnavailableError("the emulator has ended", "its error output says why")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise InvalidValueError(answer["error"])
        return answer
