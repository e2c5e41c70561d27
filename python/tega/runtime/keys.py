"""Read a terminal's keys as they are pressed, and put the terminal back however the block is left.

Ctrl-C keeps its meaning. On POSIX the terminal is taken out of line mode with termios, on Windows msvcrt is read.
"""

from __future__ import annotations

import os
import re
import select
import sys

from tega.errors import DeviceUnavailableError

# One key as a terminal sends it: a control sequence, or one character.
_KEY = re.compile(rb"\x1b(?:\[[0-9;]*[@-~]|O[@-~])|\x1b(?![\[O])|[^\x1b]", re.DOTALL)
_ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
_WINDOWS = {"H": "up", "P": "down", "M": "right", "K": "left"}


class Keys:
    """Reads keys of a terminal (``None``: standard input); ``DeviceUnavailableError`` where there is none."""

    def __init__(self, fd: int | None = None) -> None:
        self._fd = fd
        self._rest = b""

    def __enter__(self) -> Keys:
        """Take the terminal out of line mode."""
        if sys.platform != "win32":
            import termios
            import tty

            try:
                self._fd = sys.stdin.fileno() if self._fd is None else self._fd
                self._before = termios.tcgetattr(self._fd)
            except (OSError, ValueError, termios.error) as error:
                raise DeviceUnavailableError(
                    "keys cannot be read: standard input is not a terminal",
                    "run it in a terminal, without redirecting its input",
                ) from error
            tty.setcbreak(self._fd)
        return self

    def __exit__(self, *_error: object) -> None:
        """Put the terminal back."""
        if sys.platform != "win32" and self._fd is not None:
            import termios

            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def read(self) -> list[str]:
        """Return the keys pressed since the last call: characters, or ``up``, ``down``, ``left``, ``right``."""
        if sys.platform == "win32":
            return _windows_keys()
        while self._fd is not None and select.select([self._fd], [], [], 0)[0]:
            data = os.read(self._fd, 1024)
            if not data:  # the terminal has gone
                break
            self._rest += data
        keys, self._rest = split_keys(self._rest)
        return keys


def split_keys(data: bytes) -> tuple[list[str], bytes]:
    r"""Return the keys in a terminal's input, and the beginning of an incomplete sequence.

    Sequences of other keys than the arrows give nothing, so that no part of them is taken for a letter.

    Example:
        >>> split_keys(b"3\x1b[Aq\x1b[5~\x1b[")
        (['3', 'up', 'q'], b'\x1b[')
    """
    keys: list[str] = []
    while data != b"\x1b" and (found := _KEY.match(data)):
        sent, data = found[0], data[found.end() :]
        if len(sent) > 1 and sent[-1:] in _ARROWS:
            keys.append(_ARROWS[sent[-1:]])
        elif len(sent) == 1 and sent <= b"\x7f":
            keys.append(sent.decode("ascii"))
    return keys, data


def _windows_keys() -> list[str]:
    keys: list[str] = []
    if sys.platform == "win32":
        import msvcrt

        while msvcrt.kbhit():
            key = msvcrt.getwch()
            keys.append(_WINDOWS.get(msvcrt.getwch(), "") if key in {"\x00", "\xe0"} else key)
    return [key for key in keys if key]
