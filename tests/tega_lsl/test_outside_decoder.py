"""A decoder in another process, heard through real liblsl: its closures, its age, and what holds where it is stale."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import Running
from reference.processes import until
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.records import Intent
from tega.stages import MuscleSetup
from tega_lsl.decoder import OutsideDecoder, OutsideOptions

pylsl = pytest.importorskip("pylsl")
pytestmark = pytest.mark.slow

# It sends EMG of 200 Hz and, 20 times a second, the closure that it was told last; "stop" sends closures no more,
# "old" sends them with stamps of a second ago, "unix" with the time of day.
PEER = """
import random, sys, threading, time
import pylsl
name = sys.argv[1]
emg = pylsl.StreamOutlet(pylsl.StreamInfo(name + "-emg", "EMG", 2, 200, "double64", name + "-emg"))
out = pylsl.StreamOutlet(pylsl.StreamInfo(name, "TEGA", 2, pylsl.IRREGULAR_RATE, "double64", name))
word = ["0.25"]
def listen():
    for line in sys.stdin:
        word[0] = line.strip()
        print("heard", flush=True)
threading.Thread(target=listen, daemon=True).start()
print("ready", flush=True)
start, n = time.monotonic(), 0
while word[0] != "end":
    n += 10
    time.sleep(max(0.0, start + n / 200 - time.monotonic()))
    emg.push_chunk([[random.gauss(0, 20), random.gauss(0, 20)] for _ in range(10)])
    said = word[0].split()
    if said[0] != "stop":
        age = 1.0 if said[0] == "old" else pylsl.local_clock() - time.time() if said[0] == "unix" else 0.0
        out.push_sample([float(said[-1]), 0.9], pylsl.local_clock() - age)
"""


class Peer:
    def __init__(self, name: str) -> None:
        self.name = name
        self.process = subprocess.Popen(
            [sys.executable, "-c", PEER, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._receive()

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        self._receive()

    def _receive(self) -> None:
        assert self.process.stdout is not None
        assert self.process.stdout.readline() in {"ready\n", "heard\n"}


@contextmanager
def peer(name: str) -> Iterator[Peer]:
    other = Peer(name)
    with other.process:
        try:
            yield other
        finally:
            other.process.kill()


SETUP = MuscleSetup("raw", 200.0, 10, ("ch1", "ch2"), (40.0, 40.0), "live")


def decoded(decoder: OutsideDecoder, seed: int = 1) -> Intent:
    samples = np.random.default_rng(seed).normal(0, 20, (10, 2))
    (intent,) = decoder.decode(samples, np.arange(10, dtype=np.int64))
    return intent


def test_the_newest_closure_is_passed_on_and_an_old_or_bad_one_is_held() -> None:
    with peer("tega-test-outside") as other:
        decoder = OutsideDecoder(SETUP, OutsideOptions(stream=other.name))
        until(lambda: decoded(decoder).closure == 0.25)
        intent = decoded(decoder)
        assert intent.confidence == 0.9
        assert all(intent.channels)
        for bad in ("nan", "1.5", "-0.1", "old 0.75"):
            other.say("0.5")
            until(lambda: decoded(decoder).closure == 0.5 and all(decoded(decoder).channels))
            other.say(bad)
            until(lambda: not any(decoded(decoder).channels))
            held = decoded(decoder)
            assert held.confidence == 0.0
            assert held.closure == (0.75 if bad.startswith("old") else 0.5)
        other.say("1.0")
        until(lambda: decoded(decoder).closure == 1.0 and all(decoded(decoder).channels))
        other.process.kill()
        until(lambda: not any(decoded(decoder).channels))
        assert decoded(decoder).closure == 1.0


def test_no_stream_and_a_stream_of_texts_are_refused_with_what_to_do() -> None:
    with pytest.raises(DeviceUnavailableError, match="no stream with name 'tega-test-nobody'"):
        OutsideDecoder(SETUP, OutsideOptions(stream="tega-test-nobody", start_s=0.5))
    for name, rate, kind, why in (
        ("tega-test-words", pylsl.IRREGULAR_RATE, "string", "is a stream of texts"),
        ("tega-test-no-rate", float("nan"), "double64", "did not connect"),
    ):
        outlet = pylsl.StreamOutlet(pylsl.StreamInfo(name, "Markers", 1, rate, kind, name))
        with pytest.raises(DeviceUnavailableError, match=why):
            OutsideDecoder(SETUP, OutsideOptions(stream=name))
        del outlet


def test_a_closure_with_a_stamp_of_another_clock_is_never_fresh() -> None:
    with peer("tega-test-clock") as other:
        decoder = OutsideDecoder(SETUP, OutsideOptions(stream=other.name))
        until(lambda: decoded(decoder).closure == 0.25)
        other.say("unix 0.75")
        until(lambda: decoded(decoder).channels == (0, 0) and decoder.holds.startswith("stamp: "))
        assert decoded(decoder).closure == 0.25
        other.say("0.5")
        until(lambda: decoded(decoder).closure == 0.5)
        assert decoder.holds == ""


def test_a_run_holds_while_the_other_process_is_silent_and_goes_on_after_it(tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    from tega.recording.replay import replay_file

    (tmp_path / "calibration.toml").write_text(
        'format = "tega-calibration"\nversion = 1\npreset = "live"\norigin = "made up"\n[emg]\nkind = "raw"\n'
        'rate_hz = 200.0\ntau = 10\nchannels = ["ch1", "ch2"]\nmaxima = [40.0, 40.0]\n'
    )
    with peer("tega-test-outside-run") as other:
        tree: dict[str, Any] = {
            "calibration": {"file": str(tmp_path / "calibration.toml")},
            "emg": {"driver": "lsl-emg", "kind": "raw", "options": {"value": f"{other.name}-emg"}},
            "stages": {
                "decoder": {"name": "lsl", "options": {"stream": other.name}},
                "beside": [{"group": "decoder", "name": "proportional", "options": {"tau_s": 0.05}}],
            },
            "recording": {"dir": str(tmp_path / "rec"), "stop_free_mib": 0.0},
        }
        with Running(check_tree(tree, {}, base=tmp_path).config) as run:

            def closure() -> float | None:
                return None if run.view.intent is None else run.view.intent.closure

            until(lambda: run.view.state == "active")
            other.say("0.75")
            until(lambda: closure() == 0.75)
            other.say("stop")
            until(lambda: run.view.state == "hold")
            n = len(run.views)
            assert any("no channel can be believed" in one for one in run.view.alerts)
            until(lambda: len(run.views) > n + 10)
            assert {view.intent and view.intent.closure for view in run.views[n:]} == {0.75}
            other.say("0.5")
            until(lambda: run.view.state == "active" and closure() == 0.5)
    found = replay_file(tmp_path / "rec" / str(run.summary["recording"]["file"]))
    assert found.same
    assert {stream.stream for stream in found.streams} >= {"/emg/levels", "/beside/proportional/emg"}
