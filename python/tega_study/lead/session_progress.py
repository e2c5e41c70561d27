"""Show how a study session stands: drawn for the experimenter, written for the observers' consoles."""

from __future__ import annotations

import time
from pathlib import Path

from tega_study.lead.experimenter import Desk, Screen
from tega_study.lead.status_file import SessionBoard, write_board

_REDRAW_S = 0.1
_BOARD_S = 0.5


class Telling:
    """Draws and writes no more often than is of use.

    Args:
        desk: Where to draw.
        path: The board's.
    """

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
