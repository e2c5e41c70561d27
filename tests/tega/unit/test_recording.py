"""A recording in its file: schemas, tables, sums of pictures, and a damaged end."""

from __future__ import annotations

import json
import sys
import tomllib
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from reference.command import call
from reference.parts import observed
from reference.played import finger, muscles
from reference.sessions import tree
from tega.config import check_tree
from tega.config.attached import config_text
from tega.config.choose import preset_metric
from tega.errors import RecordingError, TegaError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.recording.inspection import inspect_file
from tega.recording.mcap_reader import McapReader
from tega.recording.pictures import cell_sums, read_sums
from tega.recording.replay import replay_file
from tega.records import BusFrame, Contact, HandCommand, Intent
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


def test_settings_survive_being_written_down(tmp_path: Path) -> None:
    config = check_tree(tree(tmp_path), {}, base=tmp_path).config
    assert check_tree(tomllib.loads(config_text(config)), {}, base=Path("/")).config == config


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
