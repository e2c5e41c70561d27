"""Folders that somebody else made, with links and pipes in the place of files: nothing is overwritten or waited for."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tega.errors import RecordingError, TegaError
from tega.recording.disk import SpooledFile
from tega.recording.folder import OUTPUT_NAMES, prepare_folder
from tega.recording.mcap_folder import SessionFolder, session_files
from tega.safety.dose_file import KeptDose
from tega.safety.motor_budget import MotorBudget
from tega.study.coupling import read_course
from tega.study.hand_rows import read_hand
from tega.study.lead.status_file import read_board
from tega.study.privacy import withdrawn_ids
from tega.study.touch_picture import read_touch_picture
from tega.study.touch_rows import read_touch
from tega.whole_file import new_file, write_whole

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such links and pipes"),
    pytest.mark.timeout(30),  # who waits for a pipe waits for ever
]

PRECIOUS = "precious\n"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A file that a link leads to."""
    path = tmp_path / ".bashrc"
    path.write_text(PRECIOUS)
    return path


@pytest.mark.parametrize(
    "name",
    [
        "trial-001.mcap",
        "trial-001.mcap.recovering",
        ".trial-001.mcap.PID.new",
        "trial-001.mcap.part.tail",
        "session.json",
        "session.json.new",
        ".session.json.PID.new",
    ],
)
def test_looking_into_a_session_writes_through_no_link(name: str, mine: Path, tmp_path: Path) -> None:
    session = tmp_path / "session"
    session.mkdir()
    (session / "trial-001.mcap.part").touch()
    (session / name.replace("PID", str(os.getpid()))).symlink_to(mine)
    assert [path.name for path in session_files(session)] == ["trial-001.mcap"]
    assert mine.read_text() == PRECIOUS


@pytest.mark.parametrize("name", OUTPUT_NAMES)
def test_a_run_writes_through_no_link_in_its_folder(name: str, mine: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    prepare_folder(out)  # as an earlier run left it
    (out / name).unlink(missing_ok=True)
    if name == "summary.json":
        mine.write_text('{"format": "tega-run"}')  # else the folder is refused
    (out / name).symlink_to(mine)
    before = mine.read_text()
    prepare_folder(out)
    assert mine.read_text() == before
    assert not (out / name).is_symlink()


def test_a_recording_writes_its_note_through_no_link(mine: Path, tmp_path: Path) -> None:
    part = tmp_path / "trial-001.mcap.part"
    part.with_name(f"{part.name}.tail").symlink_to(mine)
    with part.open("xb", buffering=0) as raw:
        SpooledFile(raw, part, most_bytes=1000).close()
    assert mine.read_text() == PRECIOUS


def test_a_file_is_written_whole_or_not_at_all(mine: Path, tmp_path: Path) -> None:
    path = tmp_path / "below" / "a.toml"
    write_whole(path, "ä\n", sync=True)
    assert path.read_bytes() == "ä\n".encode()
    with pytest.raises(TypeError), new_file(path) as file:
        file.writelines([b"half", None])  # type: ignore[list-item]
    assert path.read_bytes() == "ä\n".encode()
    path.unlink()
    path.symlink_to(mine)
    write_whole(path, b"new")
    assert (path.is_symlink(), path.read_bytes(), mine.read_text()) == (False, b"new", PRECIOUS)
    assert [one.name for one in path.parent.iterdir()] == ["a.toml"]


def test_what_is_left_of_a_killed_writer_is_no_hindrance(tmp_path: Path) -> None:
    path = tmp_path / "trial-001.mcap"
    (tmp_path / f".{path.name}.{os.getpid()}.new").write_bytes(b"left behind")
    write_whole(path, b"new")
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", ["session.json", "trial-001.mcap.part.tail", "trial-002.mcap.part"])
def test_a_pipe_in_a_session_is_not_waited_for(name: str, tmp_path: Path) -> None:
    (tmp_path / "trial-001.mcap.part").touch()
    os.mkfifo(tmp_path / name)
    assert [path.name for path in session_files(tmp_path)] == ["trial-001.mcap"]
    SessionFolder(tmp_path).index()


@pytest.mark.parametrize("read", [read_touch, read_hand, read_course, read_touch_picture])
def test_a_pipe_or_nonsense_in_a_study_is_an_error_that_names_it(
    read: Callable[[Path], object], tmp_path: Path
) -> None:
    pipe, odd = tmp_path / "pipe.csv", tmp_path / "odd.csv"
    os.mkfifo(pipe)
    odd.write_bytes(b't_s,finger\n"' + b"x" * 200_000 + b"\n")  # a cell longer than the csv module takes
    for path in (pipe, odd):
        with pytest.raises(RecordingError, match=path.name):
            read(path)


def test_a_pipe_is_neither_board_nor_list_nor_dose(tmp_path: Path) -> None:
    for name in ("now.json", "withdrawn.txt", "vest-dose.json", "summary.json"):
        os.mkfifo(tmp_path / name)
    assert read_board(tmp_path / "now.json") is None
    for refused in (
        lambda: withdrawn_ids(tmp_path),
        lambda: KeptDose(tmp_path / "vest-dose.json", MotorBudget()),
        lambda: prepare_folder(tmp_path),
    ):
        with pytest.raises(TegaError):
            refused()
