"""A recorded run: what the file holds, what a replay finds, and what becomes of it on a bad disk or after a kill."""

from __future__ import annotations

import csv
import io
import json
import os
import random
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer

from tega.cli.main import main
from tega.config import RecordingSection, check_tree
from tega.config_text import config_text
from tega.errors import ConfigError
from tega.recording.export import export_file
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_queue import BoundedQueue, Item
from tega.recording.mcap_recorder import McapRecorder
from tega.recording.mcap_schemas import decoder
from tega.recording.tap import SessionTap
from tega.replay import Replay, replay_file
from tega.tactile import read_contact
from tega.teleop import run_session
from tega.teleop.loop import LoopView
from tega.testing.emulators.hid_port import HidBoard, HidPort
from tega.testing.emulators.process import Emulator
from tega.testing.kills import kill_one, settings

SECONDS = 1.5


def tree(folder: Path, **recording: Any) -> dict[str, Any]:
    touch = {"driver": "synthetic-touch", "options": {"duration_s": SECONDS}}
    return {
        "session": {"pace": "fast"},
        "tactile": {
            "thumb": touch,
            "ring": {"driver": "synthetic-touch", "options": {"duration_s": 1.0, "seed": 3}},
        },
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": SECONDS}},
        "recording": {"dir": str(folder), "lossless": True, "stop_free_mib": 0.0, **recording},
    }


def record(folder: Path, **recording: Any) -> Path:
    summary = run_session(check_tree(tree(folder, **recording), {}, base=Path.cwd()).config)
    assert summary["recording"]["state"] == "complete"
    assert summary["recording"]["dropped"] == {}
    return folder / str(summary["recording"]["file"])


@pytest.fixture(scope="module")
def lossless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("session") / "lossless")


def rewritten(source: Path, target: Path, change: Callable[[str, Any], Any]) -> Path:
    """Copy a recording with the public reader and writer, changing messages on the way."""
    data = source.read_bytes()
    with target.open("wb") as new:
        writer = Writer(new)
        writer.start()
        reader = NonSeekingReader(io.BytesIO(data))
        for attachment in NonSeekingReader(io.BytesIO(data)).iter_attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        for table in NonSeekingReader(io.BytesIO(data)).iter_metadata():
            writer.add_metadata(table.name, table.metadata)
        ids: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(channel.topic, "protobuf", schema_id)
            value = decoder(schema.name, schema.data).FromString(message.data)
            changed = change(channel.topic, value).SerializeToString()
            writer.add_message(ids[channel.id], message.log_time, changed, message.publish_time)
        writer.finish()
    return target


def stream(replay: Replay, name: str) -> Any:
    return next(s for s in replay.streams if s.stream == name)


def test_a_lossless_recording_is_computed_again_bit_for_bit(lossless: Path) -> None:
    replay = replay_file(lossless)
    assert replay.same
    assert replay.complete
    rows = {s.stream: (s.recorded, s.replayed, s.differ) for s in replay.streams}
    n_hand = round(SECONDS / 0.003) + 1
    assert rows == {
        "/tactile/thumb/image": (90, 90, 0),
        "/tactile/ring/image": (60, 60, 0),
        "/tactile/thumb/contact": (90, 90, 0),
        "/tactile/ring/contact": (60, 60, 0),
        "/emg/levels": (15, 15, 0),
        "/vest/frame": (46, 46, 0),
        "/hand/frames": (n_hand, n_hand, 0),
    }


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


def test_one_altered_pixel_shows_wherever_it_is(lossless: Path, tmp_path: Path) -> None:
    choice = random.Random(5)
    at = choice.randrange(90)
    seen = []

    def change(topic: str, value: Any) -> Any:
        if topic == "/tactile/thumb/image":
            seen.append(value.timestamp)
            if len(seen) == at + 1:
                pixels = bytearray(value.data)
                pixels[choice.randrange(len(pixels))] ^= 1
                value.data = bytes(pixels)
        return value

    replay = replay_file(rewritten(lossless, tmp_path / "altered.mcap", change))
    assert not replay.same
    image = stream(replay, "/tactile/thumb/image")
    assert image.differ == 1
    assert image.first[0].t_s == pytest.approx(at / 60, abs=1e-6)


def test_a_pixel_that_is_felt_is_told_from_the_contact_to_the_vest(lossless: Path, tmp_path: Path) -> None:
    def change(topic: str, value: Any) -> Any:
        if topic == "/tactile/thumb/image":
            pixels = np.frombuffer(value.data, np.uint8).reshape(value.height, value.width, 3).copy()
            pixels[120:160, 90:150] = 255 - pixels[120:160, 90:150]
            value.data = pixels.tobytes()
        return value

    path = rewritten(lossless, tmp_path / "altered.mcap", change)
    replay = replay_file(path)
    for name in ("/tactile/thumb/image", "/tactile/thumb/contact", "/vest/frame"):
        assert stream(replay, name).differ > 0
    for name in ("/tactile/ring/contact", "/emg/levels", "/hand/frames"):
        assert stream(replay, name).differ == 0
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(path)])
    assert ended.value.code == 1


def test_other_settings_say_what_differs(
    lossless: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.toml"
    other.write_text('[vest]\nmirror = "all"\nthreshold = 20.0\n')
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(lossless.parent), "--config", str(other), "--json"])
    assert ended.value.code == 1
    (replay,) = json.loads(capsys.readouterr().out)
    assert replay["changed"] == ["vest.mirror: none -> all", "vest.threshold: 0.0 -> 20.0"]
    differ = {s["stream"]: s["differ"] for s in replay["streams"]}
    assert differ.pop("/vest/frame") > 10
    assert set(differ.values()) == {0}


def test_jpeg_replays_what_was_computed_exactly_and_tells_the_error_of_the_pictures(tmp_path: Path) -> None:
    path = record(tmp_path / "jpeg", lossless=False)
    replay = replay_file(path)
    assert replay.same
    assert not replay.lossless
    thumb, ring = sorted(replay.pictures, key=lambda p: p.finger, reverse=True)
    assert (thumb.compared, ring.compared) == (90, 60)
    assert 0 < thumb.eda_max_px < 1000
    with path.open("rb") as file:
        names = {s.name for s, _, _ in make_reader(file).iter_messages(["/tactile/thumb/image"]) if s}
    assert names == {"foxglove.CompressedImage"}


def test_a_hand_that_closes_its_own_loop_is_held_the_same_conversation(tmp_path: Path) -> None:
    with Emulator("allegro_port") as hand:
        session = tree(tmp_path / "session")
        session["session"] = {"pace": "real"}
        session["hand"] = {
            "driver": "allegro",
            "options": {**hand.address, "silent_after_ms": 10_000.0, "lowest_rate_hz": 0.0},
        }
        summary = run_session(check_tree(session, {}, base=tmp_path).config)
    replay = replay_file(tmp_path / "session" / summary["recording"]["file"])
    bus = stream(replay, "/hand/bus")
    assert bus.recorded > 100
    assert stream(replay, "/hand/frames").recorded > 50
    assert replay.same


def test_kills_at_random_instants_cost_at_most_half_a_second(tmp_path: Path) -> None:
    instants = random.Random(11)
    for k in range(3):
        folder = tmp_path / str(k)
        folder.mkdir()
        # JPEG files grow so slowly that nothing but a flush brings them to the disk in time.
        with settings(folder, synthetic=True, lossless=k > 0) as path:
            kill = kill_one(path, instants.uniform(1.0, 2.0) if k == 0 else instants.uniform(0.3, 2.0))
        assert kill.good, kill
        assert kill.messages > 50


def test_the_next_run_finishes_what_was_cut(lossless: Path, tmp_path: Path) -> None:
    data = lossless.read_bytes()
    folder = tmp_path / "session"
    folder.mkdir()
    (folder / "trial-001.mcap.part").write_bytes(data[: len(data) * 2 // 3])
    record(folder)
    assert sorted(p.name for p in folder.iterdir()) == ["session.json", "trial-001.mcap", "trial-002.mcap"]
    states = [trial["state"] for trial in SessionFolder(folder).index()["trials"]]
    assert states == ["recovered", "complete"]
    cut = replay_file(folder / "trial-001.mcap")
    assert cut.same
    assert not cut.complete
    assert 10 < stream(cut, "/tactile/thumb/contact").recorded < 90


@pytest.mark.parametrize("length", [0, 5, 40, 3000])
def test_a_file_with_hardly_anything_is_finished_too(lossless: Path, tmp_path: Path, length: int) -> None:
    (tmp_path / "trial-001.mcap.part").write_bytes(lossless.read_bytes()[:length])
    (recovered,) = SessionFolder(tmp_path).recovered
    assert recovered.n_messages == 0
    with recovered.path.open("rb") as file:
        assert list(make_reader(file).iter_messages()) == []


def image_item(k: int) -> tuple[str, int, str, Any, int]:
    image = np.random.default_rng(k).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    numbers = {"t_ns": k * 1000, "received_ns": k * 1000, "seq": k, "name": f"frame {k}"}
    return "/tactile/thumb/image", k * 1000, "image", ("thumb", image, numbers), image.nbytes


def test_a_disk_that_does_not_keep_up_costs_pictures_which_are_counted(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    let_go, data = threading.Event(), bytearray()

    def slow_disk() -> None:
        with pipe.open("rb", buffering=0) as file:
            let_go.wait()
            while part := file.read(1 << 16):
                data.extend(part)

    disk = threading.Thread(target=slow_disk)
    disk.start()
    folder = SessionFolder(tmp_path / "session")
    recorder = McapRecorder(
        folder,
        RecordingSection(lossless=True, queue_mib=4.0, stop_free_mib=0.0),
        raw=pipe.open("wb", buffering=0),
    )
    recorder.head({"tega": {"format": "test"}}, {})
    recorder.begin(0, 0)
    try:
        for k in range(100):  # 23 MB for a disk that takes nothing: every call returns all the same
            recorder.put(*image_item(k))
            recorder.marker(k * 1000, f"after {k}")
        lost = recorder.dropped
    finally:
        let_go.set()
    facts = recorder.finish()
    disk.join()
    assert set(lost) == {"/tactile/thumb/image"}
    dropped = lost["/tactile/thumb/image"]
    assert 60 < dropped < 100
    assert facts["state"] == "complete"
    assert facts["dropped"] == lost
    path = tmp_path / "slow.mcap"
    path.write_bytes(data)
    found = {s.topic: s for s in inspect_file(path).streams}
    assert found["/tactile/thumb/image"].messages == 100 - dropped
    assert found["/tactile/thumb/image"].dropped == dropped
    assert found["/run/marker"].messages == 100


FULL = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (6_000_000, 6_000_000))
from tega.cli.main import main
main(["run", sys.argv[1], "--json"])
"""


def run_full(words: list[str]) -> tuple[dict[str, Any], str]:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary, done.stderr


def check_full(summary: dict[str, Any], said: str, folder: Path, reason: str) -> None:
    assert summary["ended"] == "complete"
    assert summary["hand"]["ticks"] == round(SECONDS / 0.003)
    recording = summary["recording"]
    assert recording["state"] == "stopped"
    assert reason in recording["reason"]
    assert f"recording stopped: {recording['reason']}; the run goes on" in said
    assert sum(recording["dropped"].values()) > 100
    # What had come to the disk is there, and computes the same.
    (recovered,) = SessionFolder(folder).recovered
    assert recovered.n_messages > 20
    assert replay_file(recovered.path).same


def test_a_file_that_may_not_grow_stops_the_recording_and_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    config = check_tree(tree(tmp_path / "session"), {}, base=tmp_path).config
    path.write_text(config_text(config))
    summary, said = run_full([sys.executable, "-c", FULL, str(path)])
    check_full(summary, said, tmp_path / "session", "File too large")


def test_a_full_disk_stops_the_recording_and_not_the_run(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(disk)]
    try:
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("a small disk cannot be mounted here")
    try:
        config = check_tree(tree(disk / "session"), {}, base=tmp_path).config
        (tmp_path / "settings.toml").write_text(config_text(config))
        words = [sys.executable, "-m", "tega.cli", "run", str(tmp_path / "settings.toml"), "--json"]
        summary, said = run_full(words)
        kept = tmp_path / "kept"
        kept.mkdir()
        for part in (disk / "session").glob("*.part"):
            (kept / part.name).write_bytes(part.read_bytes())
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    check_full(summary, said, kept, "No space left on device")


def test_too_little_room_finishes_the_file_in_time(tmp_path: Path) -> None:
    config = check_tree(tree(tmp_path, stop_free_mib=1e9), {}, base=tmp_path).config
    summary = run_session(config)
    assert summary["ended"] == "complete"
    assert "recording.stop_free_mib" in summary["recording"]["reason"]
    assert replay_file(tmp_path / "trial-001.mcap").same


def test_what_is_left_out_of_a_queue_is_counted_and_small_things_go_on() -> None:
    queue = BoundedQueue(most_bytes=1000)
    for k in range(5):
        queue.put(Item("/image", k, "image", None, 400))
        queue.put(Item("/small", k, "Marker", None, 100))
    assert dict(queue.dropped) == {"/image": 3}
    taken = [queue.take() for _ in range(len(queue))]
    assert [item.topic for item in taken if item] == ["/image", "/small"] * 2 + ["/small"] * 3
    for item in taken:
        assert item is not None
        queue.done(item)
    assert queue.n_bytes == 0


def test_inspect_prints_what_is_there(lossless: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--json"], []):
        with pytest.raises(SystemExit) as ended:
            main(["inspect", str(lossless.parent), *words])
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


@pytest.mark.parametrize("content", [b"", b"no such thing", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused_in_one_sentence(
    tmp_path: Path, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(path)])
    assert ended.value.code == 1
    assert "error: other.mcap: " in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="the emulated pedal needs Linux")
def test_a_pedal_marks_the_recording_and_a_watched_run_that_is_stopped_replays(tmp_path: Path) -> None:
    session = tree(tmp_path / "session") | {"session": {"pace": "real"}}
    session["input"] = {"marker": {"driver": "pedal", "button": "b"}}
    for section in (*session["tactile"].values(), session["emg"]):
        section["options"]["duration_s"] = 30.0
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
        run_session(config, observer=watch, stop=lambda: len(held) > 10 and held[-1])
    path = tmp_path / "session" / "trial-001.mcap"
    found = inspect_file(path)
    assert [marker.text for marker in found.markers] == ["b"]
    assert found.ended == "stopped"
    assert found.states[-1].text == "stopped: asked to"
    assert replay_file(path).same


def test_tables_and_pictures_say_what_was_recorded(lossless: Path, tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["export", str(lossless), "--out", str(tmp_path / "out"), "--pictures"])
    assert ended.value.code == 0
    with (tmp_path / "out" / "tactile.thumb.contact.csv").open(newline="") as file:
        contacts = list(csv.DictReader(file))
    baseline = np.load(tmp_path / "out" / "baseline-thumb.npy")
    assert len(contacts) == 90
    for k in (0, 45, 70):
        image = cv2.imread(str(tmp_path / "out" / "thumb" / f"{k:06d}.png"))
        metrics = read_contact(np.asarray(image, np.uint8), baseline, reading="live")
        assert (int(contacts[k]["eda"]), float(contacts[k]["cci"])) == (metrics.eda, metrics.cci)
    samples = (tmp_path / "out" / "emg.samples.csv").read_text().splitlines()
    assert samples[0] == "log_ns,chunk_t_ns,index,ch1,ch2,ch3"
    assert len(samples) == 1 + round(SECONDS * 1000)
    assert (tmp_path / "out" / "hand.frames.csv").read_text().count("180#") == round(SECONDS / 0.003) + 1
    with pytest.raises(ConfigError, match="not an empty folder"):
        export_file(lossless, tmp_path / "out")


def test_parquet_has_the_same_columns(lossless: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[parquet]")
    export_file(lossless, tmp_path / "out", kind="parquet")
    table = parquet.read_table(tmp_path / "out" / "emg.levels.parquet")
    assert table.num_rows == 15
    assert table.column_names == [
        "log_ns",
        "t_ns",
        "taken_ns",
        "channels_1",
        "channels_2",
        "channels_3",
        "fused",
    ]


def test_a_loop_that_was_late_and_muted_motors_are_replayed_as_they_were(tmp_path: Path) -> None:
    looks = 0

    def slow(view: LoopView) -> None:
        if view.t_ns == 500_000_000:
            time.sleep(0.3)

    def haptics() -> bool:
        nonlocal looks
        looks += 1
        return not 15 < looks < 25

    session = tree(tmp_path / "session") | {"session": {"pace": "real"}}
    run_session(check_tree(session, {}, base=tmp_path).config, observer=slow, haptics=haptics)
    path = tmp_path / "session" / "trial-001.mcap"
    found = {s.topic: s for s in inspect_file(path).streams}
    assert found["/run/skipped"].messages > 20
    assert found["/run/haptics"].messages == 2
    assert replay_file(path).same


def test_a_level_set_against_the_muscles_is_replayed_as_it_was(tmp_path: Path) -> None:
    class Careful:
        """A hand that is asked for less than the muscles say, as a policy would."""

        def __init__(self, hand: Any) -> None:
            self._hand = hand
            self.n = 0

        def __getattr__(self, name: str) -> Any:
            return getattr(self._hand, name)

        def step(self, level: int) -> Any:
            self.n += 1
            return self._hand.step(min(level, 2) if 100 < self.n < 400 else level)

    original = SessionTap.hand

    def careful(tap: SessionTap, hand: Any) -> Any:
        return Careful(original(tap, hand))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SessionTap, "hand", careful)
        path = record(tmp_path)
    found = {s.topic: s for s in inspect_file(path).streams}
    assert found["/hand/imposed"].messages >= 2
    assert replay_file(path).same
