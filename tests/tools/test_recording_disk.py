"""What becomes of a recording on a bad disk, or when its program is killed."""

from __future__ import annotations

import errno
import io
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from reference.command import call
from reference.installed import program
from reference.sessions import SECONDS, messages, record, stream, tree
from tega.config import check_tree
from tega.config.attached import config_text
from tega.loop import run_session
from tega.recording import disk, mcap_recorder
from tega.recording.disk import RecordingDisk, rescue_tails
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder, session_files
from tega.recording.recorder_process import BoundedQueue, Item
from tega.recording.replay import replay_file
from tega.records import Marker, Picture
from tega_campaigns.kills import kill_one, settings


@pytest.mark.slow
def test_kills_at_random_instants_cost_at_most_half_a_second(tmp_path: Path) -> None:
    instants = random.Random(11)
    for lossless, earliest_s in ((False, 1.0), (True, 0.3)):
        folder = tmp_path / str(lossless)
        folder.mkdir()
        # JPEG files grow so slowly that nothing but a flush brings them to the disk in time.
        with settings(folder, synthetic=True, lossless=lossless) as path:
            kill = kill_one(path, instants.uniform(earliest_s, 2.0))
        assert kill.good, kill
        assert kill.messages > 50


def counted(data: bytes) -> Counter[str]:
    """Return how many messages each topic has, as far as the public reader can read a file."""
    topics: dict[int, str] = {}
    n: Counter[str] = Counter()
    with suppress(EndOfFile):
        for record in StreamReader(io.BytesIO(data)).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                n[topics[record.channel_id]] += 1
    return n


def test_the_next_run_finishes_what_was_cut(lossless: Path, tmp_path: Path) -> None:
    # How much of each stream a part of a file holds is the scheduler's doing: a source may be read ahead of another.
    data = lossless.read_bytes()[: lossless.stat().st_size * 2 // 3]
    kept = counted(data)
    folder = tmp_path / "session"
    folder.mkdir()
    (folder / "trial-001.mcap.part").write_bytes(data)
    record(folder, duration_s=0.2)
    assert sorted(p.name for p in folder.iterdir()) == ["session.json", "trial-001.mcap", "trial-002.mcap"]
    states = [trial["state"] for trial in SessionFolder(folder).index()["trials"]]
    assert states == ["recovered", "complete"]
    path = folder / "trial-001.mcap"
    assert Counter(topic for topic, *_ in messages(path)) == kept
    cut = replay_file(path)
    assert cut.same
    assert not cut.complete
    assert stream(cut, "/tactile/thumb/contact").recorded == kept["/tactile/thumb/contact"]


@pytest.mark.parametrize("length", [0, 5, 40, 3000])
def test_a_file_with_hardly_anything_is_finished_too(lossless: Path, tmp_path: Path, length: int) -> None:
    (tmp_path / "trial-001.mcap.part").write_bytes(lossless.read_bytes()[:length])
    (recovered,) = SessionFolder(tmp_path).recovered
    assert recovered.n_messages == 0
    with recovered.path.open("rb") as file:
        assert list(make_reader(file).iter_messages()) == []


@pytest.mark.slow
def test_a_full_disk_stops_the_recording_and_not_the_run(tmp_path: Path) -> None:
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)]
    if not shutil.which("mount") or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("a small disk cannot be mounted here")
    try:
        config = check_tree(tree(disk / "session"), {}, base=tmp_path).config
        (tmp_path / "settings.toml").write_text(config_text(config))
        # The run goes on, and its exit code says that it lacks something.
        words = (sys.executable, "-m", "tega.ui.cli", "run", tmp_path / "settings.toml", "--json")
        done = program(*words, code=1)
        shutil.copytree(disk / "session", kept)
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    summary = json.loads(done.stdout)
    assert summary["ended"] == "complete"
    assert summary["hand"]["ticks"] == round(SECONDS / 0.003)
    recording = summary["recording"]
    assert recording["state"] == "stopped"
    assert "No space left on device" in recording["reason"]
    assert f"recording stopped: {recording['reason']}; the run goes on" in done.stderr
    assert sum(recording["dropped"].values()) > 100
    # What had come to the disk is there, and computes the same.
    (recovered,) = SessionFolder(kept).recovered
    assert recovered.n_messages > 20
    assert replay_file(recovered.path).same


def test_too_little_room_finishes_the_file_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_recorder, "FLUSH_NS", 0)  # what is finished is not flushed after that
    config = check_tree(tree(tmp_path, stop_free_mib=1e9), {}, base=tmp_path).config
    summary = run_session(config)
    assert summary["ended"] == "complete"
    assert "recording.stop_free_mib" in summary["recording"]["reason"]
    path = tmp_path / summary["recording"]["file"]
    assert (replay_file(path).same, inspect_file(path).stopped) == (True, summary["recording"]["reason"])


def test_what_is_left_out_of_a_queue_is_counted_and_small_things_go_on() -> None:
    queue = BoundedQueue(most_bytes=1000)
    picture = Picture(finger="thumb", image=np.empty(0, np.uint8), t_ns=0, received_ns=0, seq=0, name="")
    for k in range(5):
        queue.put(Item(picture, k, 400))
        queue.put(Item(Marker(t_ns=k, text=""), k, 100))
    assert dict(queue.dropped) == {"/tactile/thumb/image": 3}
    assert queue.problem() == "3 records dropped: disk or processor does not keep up"
    taken = [*queue.take(401), *queue.take()]
    assert [type(item.record) for item in taken] == [Picture, Marker] * 2 + [Marker] * 3
    queue.done(taken)
    assert queue.n_bytes == 0


STUCK = """
import io, os, signal, sys, time
import numpy as np
from pathlib import Path
from tega.config import RecordingSection
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.records import Marker, Picture

class Disk(io.FileIO):
    def write(self, data):
        if self.tell() > 1_000_000:
            print("stuck", flush=True)
            time.sleep(600.0)
        return super().write(data)

folder = SessionFolder(Path(sys.argv[1]))
settings = RecordingSection(lossless=True, stop_free_mib=0.0)
recorder = McapRecorder(folder, settings)
recorder._file.disk._raw = Disk(folder.path / "trial-001.mcap.part", "r+b")
recorder.head({"tega": {"format": "test"}}, {})
recorder.begin(0, 0)
for k in range(40):
    image = np.random.default_rng(k).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    recorder.put(Picture(finger="thumb", image=image, t_ns=k, received_ns=k, seq=k, name=""))
    recorder.put(Marker(t_ns=k, text=f"after {k}"))
recorder.leave()
time.sleep(0.5)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_where_the_system_keeps_no_files_in_memory_the_disk_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_MEMORY", tmp_path / "none")
    assert len(messages(record(tmp_path / "session", duration_s=0.3))) > 50


def test_a_note_of_memory_that_is_gone_or_not_ours_is_taken_away_alone(tmp_path: Path) -> None:
    for name in ("tega-gone", "../tmp", "elsewhere"):
        (tmp_path / "trial-001.mcap.part").write_bytes(b"")
        (tmp_path / "trial-001.mcap.part.tail").write_text(name)
        SessionFolder(tmp_path)
        assert sorted(p.name for p in tmp_path.iterdir()) == ["session.json", "trial-001.mcap"]
        (tmp_path / "trial-001.mcap").unlink()


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="the system keeps no files in memory")
def test_looking_into_a_copy_takes_nothing_from_a_recording_that_goes_on(tmp_path: Path) -> None:
    live, copy = tmp_path / "live", tmp_path / "copy"
    live.mkdir()
    goes_on = STUCK.replace(
        "os.kill(os.getpid(), signal.SIGKILL)", "print('filled', flush=True); time.sleep(600)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", goes_on, str(live)], stdout=subprocess.PIPE, text=True
    ) as running:
        try:
            assert running.stdout is not None
            assert {running.stdout.readline(), running.stdout.readline()} == {"stuck\n", "filled\n"}
            memory = Path("/dev/shm") / (live / "trial-001.mcap.part.tail").read_text()
            before = {path.name for path in memory.iterdir()}
            shutil.copytree(live, copy)
            (found,) = [inspect_file(path) for path in session_files(copy)]
            assert 0 < next(s.messages for s in found.streams if s.topic == "/run/marker") < 40
            rescue_tails()
            # The recording goes on, and may add some.
            assert before <= {path.name for path in memory.iterdir()}
        finally:
            running.kill()
    (recovered,) = SessionFolder(live).recovered
    counted = {s.topic: s.messages for s in inspect_file(recovered.path).streams}
    assert counted["/tactile/thumb/image"] == counted["/run/marker"] == 40
    assert not memory.exists()


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="the system keeps no files in memory")
def test_what_a_killed_recording_left_in_memory_goes_to_its_file_when_the_next_one_begins(tmp_path):
    program(sys.executable, "-c", STUCK, tmp_path, code=-signal.SIGKILL)
    part = tmp_path / "trial-001.mcap.part"
    memory = Path("/dev/shm") / (tmp_path / "trial-001.mcap.part.tail").read_text()
    assert memory.is_dir()
    with (tmp_path / "other").open("xb", buffering=0) as raw:
        RecordingDisk(raw, tmp_path / "other", most_bytes=1000).close()
    assert not memory.exists()
    assert part.stat().st_size > 9_000_000
    (recovered,) = SessionFolder(tmp_path).recovered
    counted = {s.topic: s.messages for s in inspect_file(recovered.path).streams}
    assert counted["/tactile/thumb/image"] == counted["/run/marker"] == 40


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="the system keeps no files in memory")
def test_a_folder_in_memory_that_names_another_file_is_left_alone(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"untouched")
    with tempfile.TemporaryDirectory(prefix="tega-", dir="/dev/shm") as name:
        Path(name, "owner").write_text(json.dumps({"path": str(victim), "file": [1, 2]}))
        Path(name, "0000").write_bytes(b"overwritten")
        rescue_tails()
        assert Path(name).is_dir()
    assert victim.read_bytes() == b"untouched"


def test_an_unfinished_recording_on_a_full_disk_is_read_as_it_is(lossless, tmp_path, monkeypatch, capsys):
    whole = tmp_path / "session" / lossless.name
    whole.parent.mkdir()
    shutil.copy(lossless, whole)
    part = whole.with_name(f"{whole.name}.part")
    part.write_bytes(whole.read_bytes()[: 3 * whole.stat().st_size // 4])
    whole.unlink()
    before = part.read_bytes()

    def full(*_given: Any, **_more: Any) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("tega.recording.mcap_folder.new_file", full)
        (found,) = session_files(part.parent)
        assert found == part
        inspection = inspect_file(found)
        call(capsys, "recording", "export", part.parent, "--out", tmp_path / "tables")
        assert [made.name for made in (tmp_path / "tables").iterdir()] == [whole.stem]
        with pytest.raises(OSError, match="No space left"):
            SessionFolder(part.parent)
    assert not inspection.complete
    assert sum(one.messages for one in inspection.streams) > 50
    assert part.read_bytes() == before
    assert [file.name for file in session_files(part.parent)] == [whole.name]  # with room it is finished
