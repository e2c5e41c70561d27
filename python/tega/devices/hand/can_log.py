"""Read the CAN logs of other programs with python-can's own readers."""

from __future__ import annotations

import logging
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from tega.errors import MissingExtraError, RecordingError
from tega.runtime.child_process import python_command, python_environment
from tega.runtime.files.foreign_file import check_file
from tega.runtime.lifecycle import require
from tega.wire import CanFrame

_READERS: Final = {
    ".asc": "ASCReader",
    ".blf": "BLFReader",
    ".log": "CanutilsLogReader",
    ".trc": "TRCReader",
}
LOG_SUFFIXES: Final = (*_READERS, ".mf4")
_MOST_MIB: Final = 16 * 1024
_PATIENCE_S: Final = 300
_NO_PACKAGE: Final = 3
# A frame that is no classic one, or whose numbers a damaged log has made up.
_MOST_ID, _MOST_BYTES = 1 << 29, 64


class LoggedFrame(NamedTuple):
    """A frame of a log, classic or CAN FD (``fd``), with up to 64 bytes.

    ``t_s`` counts from the log's first frame. ``extended``: the identifier has 29 bits. ``error``: an error
    frame of the controller. ``channel`` is name or number of the bus in the log.
    """

    t_s: float
    frame: CanFrame
    extended: bool
    error: bool
    fd: bool
    channel: str


def read_can_log(path: Path) -> Iterator[LoggedFrame]:
    """Return the frames of a log in their order.

    The log is of Vector (``.asc``, ``.blf``), can-utils (``.log``), PEAK (``.trc``) or ASAM (``.mf4``, which
    needs asammdf). ``RecordingError``: it is missing, of another format, empty or damaged.
    """
    if path.suffix.lower() not in LOG_SUFFIXES:
        raise RecordingError(
            f"{path.name}: no CAN log that is read", f"its name has to end in {', '.join(LOG_SUFFIXES)}"
        )
    can: Any = require("can", driver="hand decode", extra="lab")
    try:
        check_file(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(
            f"{path.name}: cannot be read: {error.strerror}", f"looked for {path}"
        ) from error
    n, first_s = 0, 0.0
    try:
        with _messages(can, path) as messages:
            for message in messages:
                first_s = message.timestamp if n == 0 else first_s
                yield _logged(message, message.timestamp - first_s)
                n += 1
    except NotImplementedError as error:
        raise MissingExtraError(
            f"{path.name}: needs the package 'asammdf', which cannot be imported ({error})",
            "pip install asammdf",
        ) from error
    except GeneratorExit:
        raise
    except Exception as error:  # of a damaged log the readers raise what they like
        text = f"damaged after {n} frames: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
        raise RecordingError(f"{path.name}: {text}", "record it again, or cut it there") from error
    if not n:
        raise RecordingError(f"{path.name}: holds no CAN frame", "is it the right file?")


@contextmanager
def _messages(can: Any, path: Path) -> Iterator[Any]:
    """Open a log with python-can's reader, which does not print the lines that it does not know."""
    suffix, log = path.suffix.lower(), logging.getLogger("can")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        if suffix == ".mf4":
            with _converted(path) as file:
                yield can.CanutilsLogReader(file)
        else:  # a reader that refuses a file leaves one open that it has opened itself
            with (
                path.open("rb") if suffix == ".blf" else path.open(encoding="utf-8", errors="replace") as file
            ):
                yield getattr(can, _READERS[suffix])(file)
    finally:
        log.setLevel(level)


@contextmanager
def _converted(path: Path) -> Iterator[IO[str]]:
    """Return an ``.mf4`` log in can-utils' format, converted by :mod:`tega.devices.hand.mf4_program`."""
    command = python_command("tega.devices.hand.mf4_program", str(path.resolve()))
    with tempfile.TemporaryFile("w+", encoding="utf-8") as file:
        try:
            done = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.PIPE,
                env=python_environment(),
                timeout=_PATIENCE_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise ValueError(f"not read within {_PATIENCE_S} s") from None
        if done.returncode == _NO_PACKAGE:
            raise NotImplementedError("asammdf")
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise ValueError(lines[-1][:200] if lines else "asammdf gave up")
        file.seek(0)
        yield file


def _logged(message: Any, t_s: float) -> LoggedFrame:
    can_id, data = int(message.arbitration_id), bytes(message.data or b"")
    if not 0 <= can_id < _MOST_ID or len(data) > _MOST_BYTES or not -1e12 < t_s < 1e12:
        raise ValueError(f"a frame {can_id:#x} of {len(data)} bytes at {t_s:g} s")
    channel = "" if message.channel is None else str(message.channel)
    return LoggedFrame(
        t_s,
        CanFrame(can_id, data, bool(message.is_remote_frame)),
        bool(message.is_extended_id),
        bool(message.is_error_frame),
        bool(message.is_fd),
        channel,
    )
