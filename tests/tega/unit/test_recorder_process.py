"""A live run's recorder is a process: what it is given is written, and neither its death nor the run's loses more."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from reference.processes import until
from tega.config import RecordingSection
from tega.errors import ConfigError
from tega.recording import recorder_process
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.recording.recorder_process import RecorderProcess
from tega.records import Marker, Picture

SETTINGS = RecordingSection(lossless=True, stop_free_mib=0.0, warn_free_mib=0.0)
EPOCH_NS = 1_700_000_000_000_000_000


def picture(k: int) -> Picture:
    image = np.random.default_rng(k).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    return Picture(finger="thumb", image=image, t_ns=k, received_ns=k, seq=k, name="")


def begun(folder: Path, settings: RecordingSection = SETTINGS) -> RecorderProcess:
    recorder = RecorderProcess(SessionFolder(folder), settings, realtime=False)
    recorder.head({"tega": {"format": "test"}}, {})
    recorder.begin(0, EPOCH_NS)
    return recorder


def test_what_it_is_given_is_in_the_file(tmp_path: Path) -> None:
    recorder = begun(tmp_path)
    for k in range(50):
        recorder.put(picture(k))
        recorder.put(Marker(t_ns=k, text=f"after {k}"))
        if k == 25:  # a key press or a shutdown does not end it
            for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
                os.kill(recorder.pid, number)
    facts = recorder.finish(b"{}")
    assert (facts["state"], facts["dropped"], recorder.problem()) == ("complete", {}, "")
    assert (facts["written"]["/run/marker"], facts["file"]) == (50, "trial-001.mcap")
    found = {stream.topic: stream.messages for stream in inspect_file(recorder.path).streams}
    assert found["/tactile/thumb/image"] == found["/run/marker"] == 50


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
from test_recorder_process import begun, picture
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
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path), *map(str, Path(__file__).parents[:3:2])],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    (recovered,) = SessionFolder(tmp_path).recovered  # which waits for the process to leave the file
    found = {stream.topic: stream.messages for stream in inspect_file(recovered.path).streams}
    # What the run was just sending is lost with it: at most one part of 4 MiB.
    assert found["/run/marker"] >= 20
    assert found["/tactile/thumb/image"] >= 20


def test_what_the_process_refuses_is_raised_here(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path / "session")
    (tmp_path / "session").rmdir()
    (tmp_path / "session").write_text("not a folder")
    with pytest.raises(ConfigError, match="session folder 'session' is a file"):
        RecorderProcess(folder, SETTINGS, realtime=False)


def test_a_recording_that_never_began_leaves_no_file(tmp_path: Path) -> None:
    recorder = RecorderProcess(SessionFolder(tmp_path), SETTINGS, realtime=False)
    recorder.abandon()
    assert list(tmp_path.glob("trial-*")) == []
