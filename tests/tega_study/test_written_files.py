"""Files of a study as they are written: locked, and read by the tools they are for."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from reference.written import mcap_trouble
from tega.errors import DeviceUnavailableError
from tega.recording.mcap_folder import SessionFolder, in_order, session_files
from tega.runtime.files import whole_file as file_lock
from tega.runtime.files.whole_file import lock_file
from tega_study.journal import Journal, read_events

_HOLD = (
    "import sys; from pathlib import Path; from tega.runtime.files import whole_file as file_lock\n"
    "file_lock._KEEPS_READERS_OUT = sys.argv[2] == 'beside'\n"
    "path = Path(sys.argv[1]); file = path.open('ab')\n"
    "print(file_lock.lock_file(file, path), flush=True); sys.stdin.read()\n"
)


@pytest.fixture(params=["itself", "beside"])
def where(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Where the lock is: on the file, or as on Windows on one beside it."""
    monkeypatch.setattr(file_lock, "_KEEPS_READERS_OUT", request.param == "beside")
    return str(request.param)


def test_another_program_is_kept_out_until_the_first_one_is_gone(tmp_path: Path, where: str) -> None:
    path = tmp_path / "events.jsonl"
    path.touch()
    command = [sys.executable, "-c", _HOLD, str(path), where]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "True\n"
        with pytest.raises(DeviceUnavailableError, match="another program has this session open"):
            Journal(path)
        assert read_events(path) == []  # looking is allowed
        other.kill()
    with Journal(path) as journal:
        journal.add("note", t_ns=0, text="mine")
    assert len(read_events(path)) == 1


def test_a_file_that_was_closed_can_be_marked_again(tmp_path: Path, where: str) -> None:
    path = tmp_path / "trial-001.mcap.part"
    file = path.open("ab")
    assert lock_file(file, path)
    with path.open("ab") as other:
        assert not lock_file(other, path)
    file.close()
    del file, other
    gc.collect()
    with path.open("ab") as third:
        assert lock_file(third, path), where


def test_the_thousandth_recording_is_followed_by_the_next(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    for n in (1, 2, 998, 999):
        (tmp_path / f"trial-{n:03d}.mcap").touch()
        folder.note(f"trial-{n:03d}.mcap", {})
    for n in (1000, 1001):
        path = folder.new_trial()
        assert path.name == f"trial-{n}.mcap"
        path.touch()
        folder.note(path.name, {})
    numbers = [1, 2, 998, 999, 1000, 1001]
    assert [in_order(path.name)[0] for path in session_files(tmp_path)] == numbers
    assert [in_order(trial["file"])[0] for trial in folder.index()["trials"]] == numbers


def test_a_recording_of_ours_is_taken_and_one_that_was_cut_off_is_found(short: Path) -> None:
    recording = short.read_bytes()
    assert mcap_trouble(recording) == ""
    assert mcap_trouble(recording[: len(recording) // 2])


@pytest.mark.parametrize("share", [0.3, 0.6, -13, -60, -200])
def test_a_wrong_byte_among_the_messages_and_of_the_summary_is_found(short: Path, share: float) -> None:
    broken = bytearray(short.read_bytes())
    broken[round(share * len(broken)) if share > 0 else int(share)] ^= 0xFF
    assert mcap_trouble(bytes(broken))
