"""Draw a vest in a terminal: for trying things out without one."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import IO, ClassVar

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Options
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import StreamedVest, VestOptions
from tega.errors import DeviceUnavailableError

_HEADING = "  %  front L ──── R      back L ──── R"
_LINES = 6


class ScreenVestOptions(VestOptions, frozen=True):
    """Settings of :class:`ScreenVest`.

    Attributes:
        terminal: Another terminal's device, such as the answer of ``tty`` in it; none for this one (its error
            output), which is no place for it where a live view is shown already.
    """

    terminal: Path | None = None


class ScreenVest(StreamedVest):
    """Draws the intensity of each motor in percent, both panels from the wearer's left."""

    name: ClassVar[str] = "on-screen-vest"
    summary: ClassVar[str] = "a vest drawn in a terminal"
    options_type: ClassVar[type[Options]] = ScreenVestOptions
    _options: ScreenVestOptions

    def __init__(self, options: ScreenVestOptions) -> None:
        place = options.terminal
        label = "this terminal" if place is None else str(place).strip("/").replace("/", ".")
        super().__init__(options, label)

    @classmethod
    def harmless(cls, options: ScreenVestOptions) -> None:
        """Do nothing: drawing would overwrite the terminal's content."""

    def _new_link(self) -> VestLink:
        return _Screen(self._options.terminal)


class _Screen(VestLink):
    def __init__(self, terminal: Path | None) -> None:
        self._terminal = terminal
        self._out: IO[str] | None = None
        self._drawn = False

    def connect(self) -> None:
        if self._terminal is None:
            self._out = sys.stderr
            return
        try:
            # Opened without becoming this program's own terminal: its Ctrl-C is not ours.
            descriptor = os.open(self._terminal, os.O_WRONLY | getattr(os, "O_NOCTTY", 0))
        except OSError as error:
            raise DeviceUnavailableError(
                f"on-screen-vest: the terminal {self._terminal} does not open: {error.strerror}",
                "type 'tty' in the other terminal and give its answer",
            ) from error
        self._out = os.fdopen(descriptor, "w", encoding="utf-8")

    def send(self, intensities: NDArray[np.uint8]) -> None:
        if self._out is None:
            raise DeviceUnavailableError("on-screen-vest: the terminal is not open")
        up = f"\x1b[{_LINES}A" if self._drawn and self._out.isatty() else ""
        rows = intensities.reshape(2, 5, 4)
        lines = [
            "     " + "".join(f"{v:>4}" for v in front) + "     " + "".join(f"{v:>4}" for v in back)
            for front, back in zip(rows[0], rows[1], strict=True)
        ]
        try:
            self._out.write(up + "\n".join([_HEADING, *lines]) + "\n")
            self._out.flush()
        except (OSError, ValueError) as error:
            raise DeviceUnavailableError(f"on-screen-vest: the terminal is gone: {error}") from error
        self._drawn = True

    def close(self) -> None:
        if self._out is not None and self._terminal is not None:
            try:
                self._out.close()
            except OSError as error:
                raise DeviceUnavailableError(f"on-screen-vest: the terminal is gone: {error}") from error
        self._out = None
