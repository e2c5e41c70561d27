"""Runs that adapt their EMG channels: recorded, undone by a key, computed again bit for bit, trimmed, told apart."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="needs the extra tega[record]")

from reference.sessions import rewritten, stream
from tega.config import check_tree
from tega.config.calibration import Calibration, EmgMaxima, save_calibration
from tega.loop import run_session
from tega.loop.adapting import AdaptationWatch
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.recording.trim import trim_session
from tega.records import Adaptation, AdaptationSwitch, Button, Contact, HeardMarker, Intent, RunState
from tega.records.bus import Bus

RATE_HZ, FULL = 1000, 40.0


def settings(folder: Path) -> Any:
    """Return those of 64 s of two channels: rest that rises, efforts that weaken, rest again."""
    shares = [0.05, 0.05, 0.1, 0.1, 0.6, 0.5, 0.45, 0.1]
    size = np.repeat(shares, 8 * RATE_HZ)[:, np.newaxis] * FULL * 1.25
    np.save(folder / "emg.npy", np.random.default_rng(7).normal(size=(len(size), 2)) * size)
    emg = EmgMaxima(kind="raw", rate_hz=float(RATE_HZ), tau=100, channels=("ch1", "ch2"), maxima=(FULL, FULL))
    save_calibration(Calibration(preset="paper", origin="made up", emg=emg), folder / "calibration.toml")
    tree = {
        "session": {"pace": "fast", "preset": "paper"},
        "calibration": {"file": str(folder / "calibration.toml")},
        "emg": {
            "driver": "emg-file",
            "kind": "raw",
            "options": {"file": str(folder / "emg.npy"), "rate_hz": RATE_HZ, "channels": [1, 2]},
        },
        "stages": {"adaptation": {"on": True}, "beside": [{"group": "decoder", "name": "rules"}]},
        "recording": {"dir": str(folder / "rec"), "lossless": True, "stop_free_mib": 0.0},
    }
    return check_tree(tree, {}, base=folder).config


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Adaptation | AdaptationSwitch]]:
    """Return a recording in which a target was told from 32 s and the key was pressed at 60 s, and what it told."""
    folder = tmp_path_factory.mktemp("adapting")
    bus, reported = Bus(), list[Any]()
    bus.subscribe(Adaptation, reported.append)
    bus.subscribe(AdaptationSwitch, reported.append)

    def say(intent: Intent) -> None:
        if intent.t_ns == 32_000_000_000:
            bus.publish(HeardMarker(t_ns=intent.t_ns, received_ns=intent.t_ns, text="target:0.5"))
        if intent.t_ns == 45_000_000_000:  # neither is the key pressed
            bus.publish(Button(seat="undo", t_ns=intent.t_ns, seq=1, button="Enter", pressed=False))
            bus.publish(Button(seat="stop", t_ns=intent.t_ns, seq=1, button="Escape", pressed=True))
        if intent.t_ns == 60_000_000_000:
            bus.publish(Button(seat="undo", t_ns=intent.t_ns, seq=1, button="Enter", pressed=True))

    bus.subscribe(Intent, say)
    summary = run_session(settings(folder), bus=bus)
    return folder / "rec" / str(summary["recording"]["file"]), reported


def test_a_run_follows_rest_and_target_and_one_key_undoes_it(run: tuple[Path, list[Any]]) -> None:
    changes = [one for one in run[1] if isinstance(one, Adaptation)]
    assert [why for why, _ in groupby(one.why for one in changes)] == ["rest", "target", "undone"]
    assert changes[-2].gains[0] > 1.05
    assert changes[-2].offsets[0] > 0
    assert changes[-1].gains == (1.0, 1.0)
    assert changes[-1].offsets == (0.0, 0.0)


@pytest.mark.slow
def test_its_recording_is_computed_again_bit_for_bit_and_has_the_condition_of_the_muscles(
    run: tuple[Path, list[Any]],
) -> None:
    found = replay_file(run[0])
    changes = [one for one in run[1] if isinstance(one, Adaptation)]
    assert found.same
    assert stream(found, "/emg/adaptation").recorded == len(changes) > 3
    assert stream(found, "/emg/levels").recorded > 600
    # What looks on beside is given the samples as they came.
    assert stream(found, "/beside/rules/emg").differ == 0
    messages = McapReader(run[0]).messages(lambda topic: topic == "/emg/condition")
    kept = [one.value for one in messages if one.topic == "/emg/condition"]
    # Once for every second of effort: in three of eight stretches of eight seconds.
    assert 20 <= len(kept) <= 30
    assert all(len(one.median_hz) == 2 for one in kept)


@pytest.mark.slow
def test_the_switches_are_what_it_is_computed_from(run: tuple[Path, list[Any]], tmp_path: Path) -> None:
    def never(topic: str, value: Any) -> Any:
        if topic == "/emg/adaptation/switch":
            value.allowed = False
        return value

    found = replay_file(rewritten(run[0], tmp_path / "a.mcap", never))
    assert stream(found, "/emg/adaptation").replayed == 1  # the key


@pytest.mark.slow
def test_a_part_of_it_is_computed_again_too(run: tuple[Path, list[Any]], tmp_path: Path) -> None:
    part = trim_session(run[0], from_s=40.0, to_s=62.0, out=tmp_path / "part")
    found = replay_file(part)
    assert found.same
    assert stream(found, "/emg/adaptation").recorded > 0


@pytest.mark.parametrize(
    "then", [RunState(t_ns=1, state="hold", reason=""), Contact(finger="thumb", t_ns=1, in_contact=True)]
)
def test_never_in_a_hold_and_never_while_a_finger_touches(then: Any) -> None:
    bus = Bus()
    watch = AdaptationWatch(bus)
    assert watch.switches().allowed is False
    for record, allowed in ((RunState(t_ns=0, state="active", reason=""), True), (then, False)):
        bus.publish(record)
        assert watch.switches().allowed is allowed


def test_a_target_is_told_by_a_marker_and_taken_back() -> None:
    bus, found = Bus(), []
    watch = AdaptationWatch(bus)
    for text in ("target:0", "target:0.8", "other", "target:x", "target:", "target:7"):
        bus.publish(HeardMarker(t_ns=0, text=text))
        found.append(watch.switches().target)
    assert found == [0.0, 0.8, 0.8, 0.8, None, None]
