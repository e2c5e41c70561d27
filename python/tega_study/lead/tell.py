"""Show other programs on this machine how a session stands, and let them lead it, as if a key had been pressed.

The board is one small file, replaced whole at every change. It never contains the condition: observers must not know
it. A command is a line of JSON at the end of ``sessions/p01/told.jsonl``, such as ``{"do": "start"}``. Write access to
that file allows leading. A session takes commands that come while it runs, and counts them in its board.
"""

from __future__ import annotations

import time
from operator import attrgetter
from pathlib import Path
from typing import Final, Literal

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.clock import Clock
from tega.runtime.files.foreign_file import check_file, parse_json, read_foreign
from tega.runtime.files.whole_file import open_to_append, write_whole
from tega_study.journal import events_path
from tega_study.lead.experimenter import ENTER, Desk, Screen

_REDRAW_S = 0.1
_BOARD_S = 0.5
_news = attrgetter("phase", "trial", "started_ns", "health", "n_told")


class SessionBoard(msgspec.Struct, frozen=True, kw_only=True):
    """State of a session, for the observers' consoles; all times are on the session's clock.

    Attributes:
        phase: ``waiting``, ``rest``, ``ready``, ``countdown``, ``trial``, ``task``, ``questions``, ``over`` or
            ``stopped``.
        trial: Number of the trial that goes on or comes next; 0 for none.
        n_over: Trials that need nothing more.
        started_ns: When the running trial began.
        until_ns: When the rest or the window is over; ``None`` where nothing ends by itself.
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
        same = reported is not None and _news(reported) == _news(board)
        if same and not at_once and now_s - self._put_s < _BOARD_S:
            return
        self._reported, self._put_s = board, now_s
        write_board(self._path, board)


Command = Literal["start", "mark", "slip", "deformation", "drop", "undo", "end", "break", "safety", "quit"]

KEYS: Final[dict[Command, tuple[str, ...]]] = {
    "start": (ENTER,),
    "mark": (" ",),
    "slip": ("s",),
    "deformation": ("d",),
    "drop": ("x",),
    "undo": ("u",),
    "end": ("e",),
    "break": ("a",),
    "safety": ("z",),
    "quit": ("q", "q"),
}
"""What each command presses."""

FRESH_S: Final = 3.0
"""An older board belongs to a session that is not led: a led one renews it twice a second."""
_MOST_BYTES: Final = 65536
_POLL_S: Final = 0.02


class CommandLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A line of ``told.jsonl``."""

    do: Command


def commands_path(folder: Path, participant: str) -> Path:
    """Return where commands to a person's session are written."""
    return events_path(folder, participant).with_name("told.jsonl")


class CommandFile:
    """Takes commands of other programs; earlier ones are skipped.

    Commands that came while none was taken for :data:`FRESH_S`, as during a typed answer, are skipped too.
    Their sender was informed that they were not taken, so they must not begin or end a trial now. ``n_taken``
    counts lines, understood or not.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path, self._clock, self.n_taken = path, clock, 0
        self._at, self._looked_ns = self._size(), clock.now_ns()

    def _size(self) -> int:
        try:
            return self._path.stat().st_size
        except OSError:
            return 0

    def take(self) -> list[str]:
        """Return the keys that new commands press; a line that is no command presses none."""
        now_ns = self._clock.now_ns()
        stale, self._looked_ns = now_ns - self._looked_ns > FRESH_S * 1e9, now_ns
        size = self._size()
        if size <= self._at:
            self._at = size  # somebody has begun the file again
            return []
        try:
            check_file(self._path, most_mib=64)
            with self._path.open("rb") as file:
                file.seek(self._at)
                new = file.read(_MOST_BYTES)
        except (OSError, RecordingError):
            return []
        whole = new[: new.rfind(b"\n") + 1]
        if not whole and len(new) == _MOST_BYTES:
            whole = new  # no command is so long
        self._at += len(whole)
        found: list[str] = []
        for line in whole.splitlines():
            self.n_taken += 1
            try:
                keys = KEYS[parse_json(line, CommandLine).do]
            except msgspec.DecodeError:
                continue
            found += () if stale else keys
        return found


def notify(
    folder: Path, participant: str, command: Command, *, clock: Clock, timeout_s: float = 3.0
) -> SessionBoard:
    """Give a running session a command, and wait until it has taken it; return how the session stood then.

    A command does what its key would do now, which may be nothing. ``clock`` is the machine's monotonic one,
    which the session's board goes by. ``DeviceUnavailableError`` if the session is not led on this machine or
    takes longer than ``timeout_s``; ``RecordingError`` if the path for commands is a link, or not a file.
    """
    board = read_board(board_path(folder, participant))
    led = board is not None and board.phase not in {"over", "stopped"}
    if board is None or not led or not 0 <= (clock.now_ns() - board.t_ns) / 1e9 <= FRESH_S:
        raise DeviceUnavailableError(
            f"no program leads the session of {participant} on this machine, or it is waiting for a typed answer",
            f"look at its terminal, or begin it with tega-teleop study run {folder} {participant} ...",
        )
    line = msgspec.json.encode(CommandLine(command)) + b"\n"
    with open_to_append(commands_path(folder, participant)) as file:
        file.write(line)  # goes out in one call, so that two programs' lines are never mixed
    until_ns = clock.now_ns() + round(timeout_s * 1e9)
    while clock.now_ns() < until_ns:
        now = read_board(board_path(folder, participant))
        if now is not None and now.n_told > board.n_told:
            return now
        time.sleep(_POLL_S)
    raise DeviceUnavailableError(
        f"the session of {participant} did not take {command!r} within {timeout_s:g} s",
        "it may be waiting for a typed answer; look at its terminal",
    )
