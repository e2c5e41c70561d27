"""Folders with links and pipes in the place of files, or with another run's files: nothing is overwritten."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from reference.study_bench import files_of
from tega.config import check_tree
from tega.errors import CalibrationError, ConfigError, DeviceUnavailableError, RecordingError, TegaError
from tega.loop import run_session
from tega.loop.worn_vest import KeptDose
from tega.recording import mcap_reader
from tega.recording.disk import RecordingDisk
from tega.recording.mcap_folder import SessionFolder, recorded_task, recover_file, session_files
from tega.recording.remake import encode_session, merge_sessions
from tega.recording.run_tables import OUTPUT_NAMES, prepare_folder
from tega.recording.trim import trim_session
from tega.runtime.clock import SystemClock
from tega.runtime.files.foreign_file import MIB
from tega.runtime.files.whole_file import new_file, write_whole
from tega.safety.motor_budget import MotorBudget
from tega.setup.calibration.sitting import unfinished
from tega_study.attempt_rows import read_hand, read_touch
from tega_study.coupling import read_course
from tega_study.episodes.journal import EPISODES, EpisodeJournal
from tega_study.journal import Journal, events_path
from tega_study.lead.tell import board_path, commands_path, notify, read_board
from tega_study.plan import make_plan, write_plan
from tega_study.privacy import export, note_elsewhere, withdraw
from tega_study.study_notes import withdrawn_ids
from tega_study.touch_picture import read_touch_picture

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such links and pipes"),
    pytest.mark.timeout(30),  # who waits for a pipe waits for ever
]

PRECIOUS = "precious\n"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
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
        RecordingDisk(raw, part, most_bytes=1000).close()
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
    if name == "session.json":
        with pytest.raises(RecordingError, match=r"session\.json: is a pipe"):
            SessionFolder(tmp_path).index()


_MAKE: dict[str, Callable[[Path, Path], object]] = {
    "trim": lambda session, out: trim_session(session, from_s=0.1, to_s=None, out=out),
    "merge": lambda session, out: merge_sessions([session], out=out),
    "encode": lambda session, out: encode_session(session, out=out, quality=80),
    "recover": lambda session, out: recover_file(session / "trial-001.mcap", out),
}


@pytest.mark.parametrize("verb", _MAKE)
def test_a_pipe_in_the_place_of_a_recording_is_not_waited_for(verb: str, tmp_path: Path) -> None:
    session = tmp_path / "session"
    session.mkdir()
    os.mkfifo(session / "trial-001.mcap")
    with pytest.raises(RecordingError, match=r"trial-001\.mcap: is a pipe, not a file"):
        _MAKE[verb](session, tmp_path / "out")


@pytest.mark.parametrize("verb", _MAKE)
def test_a_record_longer_than_any_ends_the_file(verb, lossless, tmp_path, monkeypatch):
    assert mcap_reader.MOST_RECORD == 256 * MIB
    for module in ("mcap_copy", "mcap_index", "mcap_reader"):
        monkeypatch.setattr(f"tega.recording.{module}.MOST_RECORD", 1000)
    if verb == "recover":
        assert recover_file(lossless, tmp_path / "out.mcap").problem == "RecordLengthLimitExceeded"
        return
    with pytest.raises(RecordingError, match=r"no recording of a session|cannot be read"):
        _MAKE[verb](lossless, tmp_path / "out")


_ODD_INDEXES = [b'{"trials": [1]}', b'{"trials": [{"file": 1}]}', b"[" * 100_000, b"[]", b"\xff"]


@pytest.mark.parametrize("odd", _ODD_INDEXES)
def test_a_damaged_index_is_told_and_stays_and_recordings_are_finished(odd: bytes, tmp_path: Path) -> None:
    (tmp_path / "trial-001.mcap.part").touch()
    index = tmp_path / "session.json"
    index.write_bytes(odd)
    assert [path.name for path in session_files(tmp_path)] == ["trial-001.mcap"]
    folder = SessionFolder(tmp_path)
    discard, label = lambda: folder.discard("trial-001.mcap"), lambda: folder.label("lift")
    for refused in (label, discard, folder.begin, folder.new_trial):
        with pytest.raises(RecordingError, match=r"session\.json: no index of a session"):
            refused()
    assert index.read_bytes() == odd
    assert recorded_task(tmp_path / "trial-001.mcap") is None
    assert (tmp_path / "trial-001.mcap").is_file()


@pytest.mark.parametrize("odd", [b"[" * 100_000, b'{"format": ["tega-run"]}', b'"tega-run"'])
def test_a_damaged_summary_is_none_of_a_run(odd: bytes, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_bytes(odd)
    with pytest.raises(ConfigError, match="holds no earlier run"):
        prepare_folder(tmp_path)


@pytest.mark.parametrize(
    "odd", [b"[" * 100_000, b'[{"x":' + b"[" * 100_000, b"\xff", b'{"started": "2026-11-21T15:04:05"}']
)
def test_json_that_is_deep_or_no_text_is_an_error_of_its_file(odd: bytes, tmp_path: Path) -> None:
    (tmp_path / "odd.json").write_bytes(odd)
    with pytest.raises(CalibrationError, match="the vibration dose"):
        KeptDose(tmp_path / "odd.json", MotorBudget())
    assert unfinished(tmp_path / "odd.json", datetime.now(UTC)) is None


def test_nothing_is_added_through_a_link_or_to_a_pipe(mine: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    write_plan(make_plan(participants=2, objects=["bag"], trials=1), study)
    (study / "sessions/p01").mkdir(parents=True)
    session = SessionFolder(tmp_path / "session")
    session.begin()

    def reported() -> None:
        board = {"t_ns": SystemClock().now_ns(), "phase": "ready"}
        board_path(study, "p01").write_text(json.dumps(board))
        notify(study, "p01", "start", clock=SystemClock(), timeout_s=0.1)

    adds: list[tuple[Path, Callable[[], object]]] = [
        (events_path(study, "p01"), lambda: Journal(events_path(study, "p01"))),
        (session.path / EPISODES, lambda: EpisodeJournal(session)),
        (study / "sessions/p01/elsewhere.txt", lambda: note_elsewhere(study, "p01", tmp_path)),
        (study / "withdrawn.txt", lambda: withdraw(study, "p02")),
        (commands_path(study, "p01"), reported),
    ]
    mine.write_text("")  # which every list may be
    for path, add in adds:
        path.symlink_to(mine)
        with pytest.raises(RecordingError, match=f"{path.name}: is a link"):
            add()
        path.unlink()
        os.mkfifo(path)
        with pytest.raises(RecordingError, match=f"{path.name}.*: is a"):
            add()
        path.unlink()
    assert mine.read_text() == ""


def test_a_linked_journal_does_not_keep_a_person_from_withdrawing(mine: Path, tmp_path: Path) -> None:
    write_plan(make_plan(participants=2, objects=["bag"], trials=1), tmp_path / "study")
    events = events_path(tmp_path / "study", "p01")
    events.parent.mkdir(parents=True)
    events.symlink_to(mine)
    assert withdraw(tmp_path / "study", "p01").deleted == [events.parent]
    assert mine.read_text() == PRECIOUS


# That each reader by itself refuses a pipe is in `property/test_foreign_files.py`.
@pytest.mark.parametrize("name", ["simulation.toml", "courses/p01/p01-t01.csv"])
def test_a_pipe_in_a_study_that_is_exported_is_an_error(name: str, tmp_path: Path) -> None:
    study = tmp_path / "study"
    write_plan(make_plan(participants=1, objects=["bag"], trials=1), study)
    (study / name).parent.mkdir(parents=True, exist_ok=True)
    os.mkfifo(study / name)
    with pytest.raises(RecordingError, match=f"{Path(name).name}: is a pipe, not a file"):
        export(study, tmp_path / "out", key="k")


@pytest.mark.parametrize("read", [read_touch, read_hand, read_course, read_touch_picture])
def test_a_cell_longer_than_the_csv_module_takes_is_an_error_of_its_file(read, tmp_path):
    (tmp_path / "odd.csv").write_bytes(b't_s,finger\n"' + b"x" * 200_000 + b"\n")
    with pytest.raises(RecordingError, match=r"odd\.csv"):
        read(tmp_path / "odd.csv")


def test_a_pipe_is_neither_board_nor_list_nor_summary(tmp_path: Path) -> None:
    for name in ("now.json", "withdrawn.txt", "summary.json"):
        os.mkfifo(tmp_path / name)
    assert read_board(tmp_path / "now.json") is None
    for refuse in (withdrawn_ids, prepare_folder):
        with pytest.raises(TegaError):
            refuse(tmp_path)


EMG = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 0.5}}
AWAY = {"driver": "serial-emg", "kind": "raw", "options": {"port": "/dev/ttyNone", "rate_hz": 500.0}}


@pytest.mark.parametrize(
    "broken",
    [
        {"emg": AWAY},
        {"emg": EMG, "hand": {"driver": "python-can", "options": {"interface": "none", "channel": "x"}}},
        {"emg": EMG, "input": {"marker": {"driver": "pedal", "button": "b", "options": {"serial": "none"}}}},
    ],
    ids=["amplifier", "hand", "pedal"],
)
def test_the_results_of_the_run_before_stay_where_they_are(tmp_path: Path, broken: dict[str, object]) -> None:
    session = {"pace": "fast", "out_dir": str(tmp_path / "results")}
    run_session(check_tree({"session": session, "emg": EMG}, {}, base=tmp_path).config)
    before = files_of(tmp_path / "results")
    assert "levels.csv" in before
    session["pace"] = "real"
    refused = check_tree({"session": session, **broken}, {}, base=tmp_path).config
    with pytest.raises((DeviceUnavailableError, ConfigError)):
        run_session(refused)
    assert files_of(tmp_path / "results") == before


def test_a_folder_that_cannot_be_used_is_refused_before_any_device_is_opened(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    session = {"out_dir": str(tmp_path)}
    with pytest.raises(ConfigError, match="not empty and holds no earlier run"):
        run_session(check_tree({"session": session, "emg": AWAY}, {}, base=tmp_path).config)
    assert files_of(tmp_path) == {"thesis.txt": b"mine"}
