"""Write a session's status for the observers' consoles: one small file, replaced whole at every change.

The file never contains the condition: observers must not know it.
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega_study.lead.experimenter import Desk, Screen

_REDRAW_S = 0.1
_BOARD_S = 0.5


class SessionBoard(msgspec.Struct, frozen=True, kw_only=True):
    """State of a session, for the observers' consoles; all times are on the session's clock.

    Attributes:
        t_ns: When it was written.
        phase: ``waiting``, ``rest``, ``ready``, ``countdown``, ``trial``, ``task``, ``questions`` or
            ``over``.
        trial: Number of the trial that goes on or comes next; 0 for none.
        n_over: Trials that need nothing more.
        started_ns: When the running trial began; ``None`` where none runs.
        until_ns: When the rest or the window is over; ``None`` where nothing ends by itself.
        window_s: Time in which the object has to be lifted.
        says: Description of the preparation or of the wait.
        n_told: How many commands of other programs were taken.
        health: Problems of the devices, one sentence each.
    """

    t_ns: int
    phase: str
    trial: int = 0
    attempt: int = 1
    object: str = ""
    n_over: int = 0
    n_trials: int = 0
    started_ns: int | None = None
    until_ns: int | None = None
    window_s: float = 15.0
    says: str = ""
    n_told: int = 0
    health: tuple[str, ...] = ()


def board_path(folder: Path, participant: str) -> Path:
    """Return where a session's board is."""
    return folder / "sessions" / participant / "now.json"


def write_board(path: Path, board: SessionBoard) -> None:
    """Replace the board."""
    write_whole(path, msgspec.json.encode(board) + b"\n")


def read_board(path: Path) -> SessionBoard | None:
    """Read the board; ``None`` where there is none that can be read."""
    try:
        return parse_json(read_foreign(path, most_mib=1), SessionBoard)
    except (OSError, msgspec.DecodeError, RecordingError):
        return None


class Telling:
    """Draws and writes no more often than is of use."""

    def __init__(self, desk: Desk, path: Path) -> None:
        self._desk, self._path = desk, path
        self._drawn_s = self._put_s = float("-inf")
        self._reported: SessionBoard | None = None

    def show(self, screen: Screen, board: SessionBoard) -> None:
        """Draw the screen and write the board."""
        now_s = time.monotonic()
        if now_s - self._drawn_s >= _REDRAW_S:
            self._drawn_s = now_s
            self._desk.show(screen)
        self.put(board)

    def put(self, board: SessionBoard, *, at_once: bool = False) -> None:
        """Write the board on every change, and often enough to show that the session is led."""
        now_s, reported = time.monotonic(), self._reported
        same = reported is not None and (
            reported.phase,
            reported.trial,
            reported.started_ns,
            reported.health,
            reported.n_told,
        ) == (
            board.phase,
            board.trial,
            board.started_ns,
            board.health,
            board.n_told,
        )
        if same and not at_once and now_s - self._put_s < _BOARD_S:
            return
        self._reported, self._put_s = board, now_s
        write_board(self._path, board)
