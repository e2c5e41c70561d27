"""Keep a journal on disk: one JSON object a line, appended and synced one by one, never changed.

An entry is kept once :meth:`JsonLines.append` has returned, whatever happens to the program or the machine then. A last
line that a crash has cut off was never promised, and goes when the file is opened again.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, Generic, Self, TypeVar

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.foreign_file import check_file, parse_json, read_foreign
from tega.runtime.files.whole_file import lock_file, open_to_append

Entry = TypeVar("Entry", bound=msgspec.Struct)

_MOST_MIB = 256
_RESTORE = "restore the file from a copy"


def read_json_lines(path: Path, kind: type[Entry], subject: str) -> list[Entry]:
    """Read a journal; a last line that was cut off is passed over, a missing file holds none.

    A field ``n`` of ``kind`` counts the lines from 1; missing lines are refused. ``subject`` names an entry,
    such as ``event``.
    """
    return _parse(read_foreign(path, most_mib=_MOST_MIB), path, kind, subject)[0] if path.exists() else []


def _parse(content: bytes, path: Path, kind: type[Entry], subject: str) -> tuple[list[Entry], int]:
    """Return the entries, and how many bytes of the file they take, a missing last newline not counted."""
    entries: list[Entry] = []
    good = 0
    *whole, last = content.split(b"\n")
    for number, line in enumerate([*whole, last] if last else whole, start=1):
        try:
            entry = parse_json(line, kind)
        except msgspec.DecodeError as error:
            if number > len(whole):  # no newline behind it: its program was stopped there
                break
            raise RecordingError(f"{path}: line {number} is no {subject}: {error}", _RESTORE) from error
        count = getattr(entry, "n", number)
        if count != number:
            raise RecordingError(
                f"{path}: line {number} holds {subject} {count}, so lines were taken out or put in", _RESTORE
            )
        entries.append(entry)
        good += len(line) + (number <= len(whole))
    return entries, good


class JsonLines(Generic[Entry]):
    """A journal, open to be added to; one program at a time. The file and its folder are made where missing.

    ``kind`` and ``subject`` are those of :func:`read_json_lines`. Where another program has the file open,
    this is ``DeviceUnavailableError`` with ``taken``, message and hint; ``RecordingError`` where the file is
    a link or holds something else.
    """

    def __init__(self, path: Path, kind: type[Entry], subject: str, *, taken: tuple[str, str]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = not path.exists()
        if not new:
            check_file(path, most_mib=_MOST_MIB)
        self._path = path
        self._file: IO[bytes] = open_to_append(path)
        try:
            if not lock_file(self._file, path):
                raise DeviceUnavailableError(*taken)  # noqa: TRY301  # the file is closed below
            self._file.seek(0)
            content = self._file.read()
            self.entries, good = _parse(content, path, kind, subject)
            if good < len(content):
                self._file.truncate(good)
            if good and content[good - 1 : good] != b"\n":  # stopped between an entry and its newline
                self._put(b"\n")
            if new:
                _sync_folder(path.parent)
        except BaseException:
            self.close()
            raise

    def append(self, entry: Entry) -> Entry:
        """Add an entry and return it; when this returns it is on the disk."""
        self._put(msgspec.json.encode(entry) + b"\n")
        self.entries.append(entry)
        return entry

    def _put(self, content: bytes) -> None:
        if self._file.closed:
            raise RecordingError(f"{self._path}: is closed", "open the journal again")
        self._file.write(content)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; closing twice does nothing."""
        self._file.close()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self.close()


def _sync_folder(folder: Path) -> None:
    """Make sure that the file's name is on the disk too, where folders can be synced."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
