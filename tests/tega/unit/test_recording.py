"""A recording in its file, a damaged end, and the process that writes it."""

from __future__ import annotations

import json
import os
import signal
import sys
import tomllib
from contextlib import nullcontext, suppress
from io import BytesIO
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar, cast
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from msgspec.structs import replace

from reference.command import call
from reference.installed import program
from reference.parts import observed
from reference.played import finger, muscles
from reference.processes import until
from reference.sessions import rewritten, tree
from tega.config import RecordingSection, check_tree
from tega.config.choose import preset_metric
from tega.errors import ConfigError, RecordingError, TegaError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.recording import mcap_recorder, recorder_process
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_reader import McapReader
from tega.recording.mcap_recorder import McapRecorder
from tega.recording.pictures import cell_sums, read_sums
from tega.recording.recorder_process import RecorderProcess
from tega.recording.remake import encode_session
from tega.recording.replay import replay_file
from tega.recording.replay.feed import Newest
from tega.records import BusFrame, Contact, HandCommand, Intent, Marker, Picture
from tega.records.base import Ns, Record
from tega.records.run import Alert, RecorderStatus, RunState
from tega.records.table import columns, numbers, rows
from tega.runtime.files.csv_tables import time_text
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator


def test_the_public_reader_finds_well_known_schemas_times_and_files(lossless: Path) -> None:
    with lossless.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        schemas = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
        assert schemas["/tactile/thumb/image"] == "foxglove.RawImage"
        assert schemas["/hand/joints"] == "foxglove.JointStates"
        assert schemas["/emg/samples"] == "tega.EmgSamples"
        files = {a.name: a.data for a in reader.iter_attachments()}
        tables = {t.name: t.metadata for t in reader.iter_metadata() if t.name != "tega"}
    assert tomllib.loads(files["session.toml"].decode())["emg"]["kind"] == "raw"
    assert tables["versions"]["tega"]
    assert json.loads(files["summary.json"])["ended"] == "complete"
    index = json.loads((lossless.parent / "session.json").read_text())
    assert [trial["state"] for trial in index["trials"]] == ["complete"]


def test_inspect_prints_what_is_there(lossless: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "/tactile/thumb/contact" in call(capsys, "recording", "inspect", lossless.parent)[0]
    (found,) = json.loads(call(capsys, "recording", "inspect", lossless.parent, "--json")[0])
    streams = {s["topic"]: s for s in found["streams"]}
    assert streams["/emg/samples"]["rate_hz"] == pytest.approx(1000.0)
    assert streams["/tactile/thumb/image"]["rate_hz"] == pytest.approx(60.0)
    assert (found["ended"], found["complete"]) == ("complete", True)


def test_inspect_detects_a_clock_that_was_set_and_a_wrong_checksum(lossless, tmp_path, capsys) -> None:
    def set_back(topic: str, value: Any) -> Any:
        if topic == "/emg/samples" and value.first_index >= 500:
            value.t_ns -= 160_000_000
        return value

    changed = rewritten(lossless, tmp_path / "a.mcap", set_back)
    (emg,) = (one for one in inspect_file(changed).streams if one.topic == "/emg/samples")
    assert [emg.back, emg.rate_hz] == pytest.approx([1, 1000.0])
    reader = StreamReader(BytesIO(data := lossless.read_bytes()), emit_chunks=True)
    *_, last = (record for record in reader.records if isinstance(record, Chunk))
    changed.write_bytes(data.replace(last.uncompressed_crc.to_bytes(4, "little"), b"\1\2\3\4", 1))
    assert "CRCValidationError" in "".join(call(capsys, "recording", "inspect", changed))
    with pytest.raises(RecordingError, match="CRCValidationError"):
        encode_session(changed, out=tmp_path / "out", quality=80)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the emulated pedal needs Linux")
def test_a_pedal_marks_the_recording_and_a_watched_run_that_is_stopped_replays(tmp_path: Path) -> None:
    session = tree(tmp_path / "session") | {"session": {"pace": "real"}}
    session["input"] = {"marker": {"driver": "pedal", "button": "b"}}
    session["tactile"] = {name: finger(30.0, shape=(60, 80)) for name in session["tactile"]}
    session["emg"] = muscles(30.0)
    held: list[bool] = []
    with (
        Emulator("hid_input", "--device", "pedal-keyboard") as foot,
        HidPort(HidBoard(foot.port, 0x0C45, 0x7403)).installed(),
    ):

        def watch(view: LoopView) -> None:
            if view.t_ns == 0:
                foot.say("press 0")
            held.append(view.inputs["marker"].held)

        config = check_tree(session, {}, base=tmp_path).config
        run_session(config, controls=Controls(stop=lambda: len(held) > 10 and held[-1]), bus=observed(watch))
    path = tmp_path / "session" / "trial-001.mcap"
    found = inspect_file(path)
    assert [marker.text for marker in found.markers] == ["b"]
    assert found.ended == "stopped"
    assert found.states[-1].text == "stopped: asked to"
    assert replay_file(path).same


@pytest.mark.parametrize("metadata", [True, False])
@pytest.mark.parametrize("channel", [True, False])
def test_a_file_with_a_damaged_end_is_called_cut_unless_nothing_of_mcap_is_in_it(tmp_path, metadata, channel):
    path = tmp_path / "trial-001.mcap"
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        if metadata:
            writer.add_metadata("tega", {"format": "tega-recording"})
        if channel:
            schema = writer.register_schema("State", "protobuf", b"")
            writer.register_channel("/run/state", "protobuf", schema)
        writer.finish()
    path.write_bytes(path.read_bytes()[:-8] + b"\x00" * 8)
    reader = McapReader(path)
    with nullcontext() if metadata or channel else pytest.raises(RecordingError, match="no MCAP file"):
        assert list(reader.messages()) == []
        assert reader.cut == "InvalidMagic"
    assert ("tega" in reader.metadata) == metadata


def test_a_row_has_as_many_cells_as_its_table_has_columns() -> None:
    contact = Contact(finger="thumb", t_ns=1_500_000, in_contact=True, cci=0.1, eda=3)
    assert rows(contact) == [f"{time_text(1_500_000)},thumb,0.1,3,0.0,0.0,0.0,1,0.0,0.0,,,,,\n"]
    assert rows(contact)[0].count(",") == len(columns(Contact)) - 1
    assert rows(Intent(t_ns=0, channels=(2, 5), level=3))[0].endswith(",2,5,3,,\n")
    requested = HandCommand(t_ns=0, level=1, frames=(BusFrame(0x180, b"\x01\xff"), BusFrame(0x20, b"", True)))
    assert [row.split(",", 1)[1] for row in rows(requested)] == ["180,01FF\n", "020,R\n"]


def test_numbers_kept_in_memory_are_those_of_the_row_with_the_time_in_seconds() -> None:
    intent = Intent(t_ns=1_500_000_000, channels=(2, 5), level=3, closure=0.5, confidence=0.25)
    assert numbers(intent) == (1.5, 2, 5, 3, 0.5, 0.25)


def test_the_sums_are_those_of_the_pixels_and_give_the_same_contact() -> None:
    rng = np.random.default_rng(3)
    baseline, image = (rng.integers(0, 256, (240, 320, 3), np.uint8) for _ in range(2))
    sums = read_sums(cell_sums(image, cv2))
    plain = image.reshape(30, 8, 40, 8, 3).sum(axis=(1, 3)).transpose(2, 0, 1).reshape(3, -1)
    assert np.array_equal(sums, plain)
    by_pixels, by_sums = preset_metric("live", baseline), preset_metric("live", baseline)
    assert by_sums.update_sums(sums, 0) == by_pixels.update(image, 0)


@pytest.mark.parametrize("shape", [(480, 640, 3), (244, 320, 3), (120, 160, 3)])
def test_a_picture_whose_cells_are_no_8_pixels_has_no_sums(shape: tuple[int, int, int]) -> None:
    assert cell_sums(np.zeros(shape, np.uint8), cv2) == b""


def test_damaged_sums_are_refused() -> None:
    cells = cell_sums(np.zeros((240, 320, 3), np.uint8), cv2)
    with pytest.raises(RecordingError, match="7199 bytes"):
        read_sums(cells[:-1])
    metric = preset_metric("live", np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(TegaError):
        metric.update_sums(read_sums(cells[:-6]), 0)


SETTINGS = RecordingSection(lossless=True, stop_free_mib=0.0, warn_free_mib=0.0)


def picture(k: int) -> Picture:
    image = np.random.default_rng(k).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    return Picture(finger="thumb", image=image, t_ns=k, received_ns=k, seq=k, name="")


class Own(Record, frozen=True, kw_only=True):
    topic: ClassVar[str] = "/own"
    t_ns: Ns


NO_SPACE, WRONG = OSError(28, "no space"), cast("str", 3)
FULL = Mock(side_effect=NO_SPACE)


@pytest.mark.parametrize(
    ("refused", "error", "stops"),
    [
        (Own(t_ns=0), NO_SPACE, True),
        (Own(t_ns=0), ValueError(), False),
        (Marker(t_ns=0, text=""), ValueError(), True),
        (Marker(t_ns=0, text=WRONG), TypeError(), False),
    ],
)
def test_a_record_that_cannot_be_written_stops_the_recording_or_costs_itself(
    tmp_path, monkeypatch, caplog, refused, error, stops
):
    recorder = McapRecorder(SessionFolder(tmp_path), replace(SETTINGS, warn_free_mib=1e9))
    recorder.begin(0, 0)
    write, reported = recorder._file.write, list[RecorderStatus]()

    def write_others(record: Record, t_ns: int) -> None:
        if record is refused and not isinstance(error, TypeError):  # which is the encoder's own
            raise error
        if isinstance(record, RecorderStatus):
            reported.append(record)
        write(record, t_ns)

    monkeypatch.setattr(recorder._file, "write", write_others)
    monkeypatch.setattr(mcap_recorder, "FLUSH_NS", 0)
    for record in (refused, refused, RunState(t_ns=3, state="idle", reason="")):
        recorder.put(record)
    assert {one.dropped_counts for one in reported} == (set() if stops else {(1,), (2,)})
    full = NO_SPACE if stops else RecordingError("damaged")
    monkeypatch.setattr(SessionFolder, "note", Mock(side_effect=full))
    facts = recorder.finish()
    problem = f"{refused.topic} could not be written: {type(error).__name__}: {error}"
    assert (facts["reason"], recorder.problem()) == ((problem, f"stopped: {problem}") if stops else ("", ""))
    assert facts["dropped"] == ({refused.topic: 1, "/run/state": 1} if stops else {refused.topic: 2})
    assert caplog.text.count(problem) == 1
    assert caplog.text.count("MiB left on the disk") == (not stops)
    assert f"the index could not be written: {full}" in caplog.text


@pytest.mark.parametrize(
    ("part", "name", "broken", "n", "reason"),
    [
        ("_file.disk", "_raw", Mock(write=FULL), 0, "the disk took no more: no space"),
        ("_folder", "path", Path("/dev/null/gone"), 1, "the file could not be flushed: "),
        ("", "_part", Path("/dev/null/gone"), 1, "the file could not be finished: "),
        ("_file", "_writer", Mock(close=FULL), 1, "the file could not be finished: OSError"),
    ],
)
def test_a_file_that_cannot_be_finished_is_not_called_complete(tmp_path, part, name, broken, n, reason):
    recorder = McapRecorder(SessionFolder(tmp_path), SETTINGS)
    setattr(attrgetter(part)(recorder) if part else recorder, name, broken)
    recorder.begin(0, 0)
    for _ in range(n):
        recorder.put(Marker(t_ns=1, text=""))
    facts = recorder.finish()
    assert facts["reason"].startswith(reason)
    assert (facts["state"], facts["file"]) == ("stopped", recorder._part.name)
    assert (recorder._file._raw.closed, recorder._file.disk._thread.is_alive()) == (True, False)
    recorder.leave()


def test_two_records_of_one_time_are_returned_in_turn() -> None:
    newest = Newest[Marker]()
    newest.rows.extend(Marker(t_ns=t_ns, text=text) for t_ns, text in ((1, "a"), (2, "b"), (2, "c")))
    found = [newest.at(t_ns) for t_ns in (2, 2, 2, 3)]
    assert [one and one.text for one in found] == ["b", "c", None, None]


def begun(folder: Path, settings: RecordingSection = SETTINGS) -> RecorderProcess:
    recorder = RecorderProcess(SessionFolder(folder), settings, realtime=False)
    recorder.head({"tega": {"format": "test"}}, {})
    recorder.begin(0, 1_700_000_000_000_000_000)
    return recorder


def test_what_it_is_given_is_in_the_file(tmp_path: Path) -> None:
    recorder = begun(tmp_path)
    for k in range(50):
        recorder.put(picture(k))
        recorder.put(Marker(t_ns=k, text=f"after {k}"))
        recorder.put(Alert(t_ns=k, name="emg", said="waits" * (k == 0)))
        if k == 25:  # a key press or a shutdown does not end it
            for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
                os.kill(recorder.pid, number)
    facts = recorder.finish(b"{}")
    assert (facts["state"], facts["dropped"], recorder.problem()) == ("complete", {}, "")
    assert (facts["written"]["/run/marker"], facts["file"]) == (50, "trial-001.mcap")
    found = {stream.topic: stream.messages for stream in inspect_file(recorder.path).streams}
    assert found["/tactile/thumb/image"] == found["/run/marker"] == 50
    assert [state.text for state in inspect_file(recorder.path).states][:2] == ["waits", "over: waits"]


def test_a_process_that_stands_still_costs_pictures_which_are_counted_and_nobody_waits(tmp_path):
    recorder = begun(tmp_path, RecordingSection(lossless=True, queue_mib=4.0, stop_free_mib=0.0))
    os.kill(recorder.pid, signal.SIGSTOP)
    for k in range(100):  # 23 MB for a process that takes one or two
        recorder.put(picture(k))
        recorder.put(Marker(t_ns=k, text=f"after {k}"))
    assert "records dropped" in recorder.problem()
    os.kill(recorder.pid, signal.SIGCONT)
    facts = recorder.finish()
    assert set(facts["dropped"]) == {"/tactile/thumb/image"}
    found = {stream.topic: stream for stream in inspect_file(recorder.path).streams}
    assert found["/run/marker"].messages == 100
    pictures = found["/tactile/thumb/image"]
    assert pictures.dropped == facts["dropped"]["/tactile/thumb/image"] == 100 - pictures.messages > 50


def test_a_process_that_stands_still_with_a_full_pipe_does_not_keep_the_run(tmp_path, monkeypatch):
    recorder = begun(tmp_path)
    until(lambda: recorder.state == "recording")
    monkeypatch.setattr(recorder_process, "_ANSWER_S", 1.0)
    os.kill(recorder.pid, signal.SIGSTOP)
    with suppress(BlockingIOError):
        os.set_blocking(recorder._requested.fileno(), False)
        while True:
            os.write(recorder._requested.fileno(), bytes(1024))
    os.set_blocking(recorder._requested.fileno(), True)
    facts = recorder.finish(bytes(2_000_000))
    assert (facts["state"], facts["file"]) == ("stopped", "trial-001.mcap.part")
    assert "recorder's process ended" in facts["reason"]


def test_a_killed_process_stops_the_recording_with_a_word_and_the_file_is_recovered(tmp_path: Path) -> None:
    recorder = begun(tmp_path)
    recorder.put(Marker(t_ns=1, text="before"))

    part = recorder.path.with_name(f"{recorder.path.name}.part")

    def is_written() -> bool:
        return any(stream.topic == "/run/marker" for stream in inspect_file(part).streams)

    until(is_written)
    os.kill(recorder.pid, signal.SIGKILL)

    def stopped() -> bool:
        recorder.put(Marker(t_ns=2, text="lost"))
        return recorder.state == "stopped"

    until(stopped)
    assert "recorder's process ended" in recorder.problem()
    facts = recorder.finish()
    assert (facts["state"], facts["file"]) == ("stopped", "trial-001.mcap.part")
    assert facts["dropped"]["/run/marker"] >= 1
    # A run's last words name them all.
    another = McapRecorder(SessionFolder(tmp_path / "another"), SETTINGS)
    assert facts.keys() == another.finish().keys()
    assert facts["bytes"] > 0
    (recovered,) = SessionFolder(tmp_path).recovered
    (stream,) = (s for s in inspect_file(recovered.path).streams if s.topic == "/run/marker")
    assert stream.messages == 1


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from test_recording import begun, picture
from tega.records import Marker
import time
recorder = begun(Path(sys.argv[1]))
for k in range(40):
    recorder.put(picture(k))
    recorder.put(Marker(t_ns=k, text=f"after {k}"))
while len(recorder._queue):
    time.sleep(0.01)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_had_left_a_killed_run_is_written(tmp_path: Path) -> None:
    program(sys.executable, "-c", KILLED, tmp_path, *Path(__file__).parents[:3:2], code=-signal.SIGKILL)
    (recovered,) = SessionFolder(tmp_path).recovered  # which waits for the process to leave the file
    found = {stream.topic: stream.messages for stream in inspect_file(recovered.path).streams}
    # What the run was just sending is lost with it: at most one part of 4 MiB.
    assert found["/run/marker"] >= 20
    assert found["/tactile/thumb/image"] >= 20


def test_what_the_process_refuses_is_raised_here(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path / "session")
    (tmp_path / "session").rmdir()
    (tmp_path / "session").write_text("not a folder")
    with pytest.raises(RecordingError, match="session/monday: no folder can be made there: Not a directory"):
        SessionFolder(tmp_path / "session/monday")
    with pytest.raises(ConfigError, match="session folder 'session' is a file"):
        RecorderProcess(folder, SETTINGS, realtime=False)


def test_a_recording_that_never_began_leaves_no_file(tmp_path: Path) -> None:
    recorder = RecorderProcess(SessionFolder(tmp_path), SETTINGS, realtime=False)
    recorder.abandon()
    assert list(tmp_path.glob("trial-*")) == []
