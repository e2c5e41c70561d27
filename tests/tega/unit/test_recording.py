"""A recorded run: what its file holds, and what is told of it."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import pytest
from mcap.reader import make_reader

from reference.parts import observed
from reference.played import finger, muscles
from reference.sessions import tree
from tega.config import check_tree
from tega.config.text import config_text
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.recording.inspection import inspect_file
from tega.recording.replay import replay_file
from tega.ui.cli.main import main
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
    for words in (["--json"], []):
        with pytest.raises(SystemExit) as ended:
            main(["recording", "inspect", str(lossless.parent), *words])
        assert ended.value.code == 0
        out = capsys.readouterr().out
        if words:
            (found,) = json.loads(out)
            streams = {s["topic"]: s for s in found["streams"]}
            assert streams["/emg/samples"]["rate_hz"] == pytest.approx(1000.0)
            assert streams["/tactile/thumb/image"]["rate_hz"] == pytest.approx(60.0)
            assert (found["ended"], found["complete"]) == ("complete", True)
        else:
            assert "/tactile/thumb/contact" in out


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
