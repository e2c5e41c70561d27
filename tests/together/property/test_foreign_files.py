"""Files of guests and tools that were damaged, or made on purpose: every reader ends with TEGA's own errors."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import tempfile
import threading
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.filmed import film, packets, write_scene
from reference.foreign_readers import Reader
from reference.mutated import (
    CHANGE,
    FEW,
    SPOT,
    ends_with_errors_however_mutated,
    mutated,
    odd,
    refuses_a_huge_file,
    refuses_what_is_no_file,
)
from reference.recordings import pressed
from reference.results import trial_result
from reference.ros2 import BEGIN_NS, write_bag
from reference.ros2 import array as ros2_array
from reference.ros2 import raw as ros2_raw
from tega.config.calibration.records import read_record, write_record
from tega.errors import TegaError
from tega.recording.replay.followed_file import PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.clock import ManualClock
from tega.runtime.files.foreign_file import read_foreign
from tega_bench.vest_latency.log import OnsetLog, read_log, read_wav, write_wav
from tega_figures.audit import read_marks
from tega_figures.audit.truth import read_forces
from tega_learn.decoders import fit
from tega_learn.logs import PracticeRecord, read_tracked
from tega_learn.model import load_model
from tega_link.keys import _authority, expiry, make_keys
from tega_practice.kept import FittsRecord
from tega_practice.tracking import keep_tracked
from tega_ros2.bag_emg import Ros2Emg, Ros2EmgOptions
from tega_ros2.bag_pictures import Ros2Pictures, Ros2PicturesOptions
from tega_scene.layout import example_layout, load_layout, save_layout
from tega_scene.lens import Lens, load_lens, save_lens
from tega_scene.offset import read_flashes
from tega_scene.pictures import read_offsets, read_pictures, read_times
from tega_scene.played import followed_scene
from tega_scene.record import export_camera, record_cameras
from tega_sim.operator import load_parameters
from tega_sim.score import TrialEvent
from tega_sim.trials import read_results
from tega_sim.world.objects import read_objects as read_simulated
from tega_study.attempt_rows import read_hand, read_touch
from tega_study.bundle import open_bundle, write_bundle
from tega_study.coupling import TouchCourse, read_course, write_course
from tega_study.episodes.journal import EpisodeLine, read_episodes
from tega_study.journal import Journal, events_path, read_events
from tega_study.lead.tell import CommandFile, SessionBoard, read_board
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.score import clips, recorded
from tega_study.silico.assumptions import read_assumptions, read_parameters
from tega_study.study_notes import read_objects
from tega_study.touch_picture import read_touch_picture

_MADE = datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC)


def _file(name: str, write: Callable[[Path], object]) -> Callable[[Path], bytes]:
    def made(folder: Path) -> bytes:
        write(folder / name)
        return (folder / name).read_bytes()

    return made


def _written(name: str, write: Callable[[Path], object], read: Callable[[Path], object]) -> Reader:
    return name, _file(name, write), read


def _write_journal(path: Path) -> None:
    with Journal(path) as journal:
        for trial in range(3):
            journal.add("trial_start", t_ns=trial * 10, trial=trial + 1)
            journal.add("trial_end", t_ns=trial * 10 + 5, trial=trial + 1, status="done", success=True)


def _write_bag(path: Path) -> None:
    messages: list[Any] = []
    for k in range(4):
        t_ns = BEGIN_NS + k * 30_000_000
        messages.append(("/gel", "image", t_ns, ros2_raw(pressed(0.5, noise=k), "rgb8", t_ns)))
        emg = ros2_array(np.ones((2, 3), np.float32), ("samples", "channels"))
        messages.append(("/emg", "array", t_ns, emg))
    write_bag(path, messages)


def _read_all(source: Any) -> None:
    with source:
        while source.read(0.0) is not None:
            pass


@functools.cache
def _model() -> bytes:
    target = np.tile(np.repeat([0.0, 1.0], 200), 8)
    samples = np.random.default_rng(1).normal(size=(len(target), 1)) * (5 + 50 * target[:, None])
    return msgspec.json.encode(fit(samples, target, rate_hz=200, tau=20, kind="raw").model)


def _read_tracked(path: Path) -> None:
    record = PracticeRecord(
        made=_MADE, device="tty", driver="cyton", person="p01", preset="live", seed=1, duration_s=0.1,
        in_target_percent=50.0, rms_error_levels=0.5, kind="raw", rate_hz=200.0, channels=("a", "b"),
    )  # fmt: skip
    write_record(record, path.with_suffix(".toml"))
    read_tracked(path.with_suffix(".toml"))


_CLIPS = b"""{"format": "tega-clips", "version": 1, "plan": "0", "rater": "r1", "proposed": true, "clips": [
{"name": "clip-001", "participant": "p01", "trial": 1, "attempt": 1, "length_s": 1.3,
"proposals": [{"source": "rule", "kind": "slip", "t_s": 0.5, "confidence": 1.0}]}], "left_out": []}"""


def _made_plan() -> StudyPlan:
    return make_plan(participants=2, seed=1, objects=["bottle"], trials=2)


def _plan(name: str) -> Callable[[Path], bytes]:
    return _file(f"study/{name}", lambda path: write_plan(_made_plan(), path.parent))


def _read_plan(path: Path) -> None:
    """Read a plan whose other file is as it should be, and whose digest says that this one is."""
    if path.name == "plan.csv":
        digest = hashlib.sha256(read_foreign(path, most_mib=64)).hexdigest()
        settings = _plan("study.toml")(path.parent / "made").decode()
        (path.parent / "study.toml").write_text(
            re.sub(r'plan_sha256 = "\w*"', f'plan_sha256 = "{digest}"', settings), encoding="utf-8"
        )
    else:
        (path.parent / "plan.csv").write_bytes(_plan("plan.csv")(path.parent / "made"))
    shutil.rmtree(path.parent / "made")
    read_plan(path.parent)


def _write_course(path: Path) -> None:
    t_s = np.arange(1, 20) / 30
    write_course(path, TouchCourse(t_s, t_s, t_s, np.round(t_s)))


def _write_picture(path: Path) -> None:
    frame, baseline = pressed(0.5, noise=1), pressed(0.0, noise=1)
    np.savez(path, finger="thumb", preset="paper", baseline=baseline, frame=frame, maxima=[1.0, 9000.0])


def _write_bundle(path: Path) -> None:
    study = path.parent / "study"
    write_plan(_made_plan(), study)
    events = events_path(study, "p01")
    events.parent.mkdir(parents=True)
    _write_journal(events)
    write_bundle(study, "p01", path)


def _open_bundle(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        open_bundle(path, Path(folder) / "opened")


def _write_scene(path: Path) -> None:
    cameras = {"front": str(film(path.with_name("film.avi"), 3))}
    record_cameras(path, cameras, size=(192, 128), rate_hz=30, stop=lambda: False)


def _write_mp4(path: Path) -> None:
    _write_scene(path.with_name("scene.mcap"))
    export_camera(path.with_name("scene.mcap"), "front", path)


def _onset_log() -> bytes:
    log = OnsetLog(
        made=_MADE, driver="vest", device="v", layout="x40", motor=2, percent=60, on_s=0.5, bursts_s=(0.8,)
    )
    return msgspec.json.encode(log)


def _results() -> bytes:
    result = trial_result(events=(TrialEvent("slip", 3.0, 0.004),))
    return 2 * (msgspec.json.encode(result) + b"\n")


def _episodes() -> bytes:
    begun = EpisodeLine(1, "begun", 5.0, "trial-001.mcap", "lift")
    kept = EpisodeLine(1, "kept", 9.5, duration_s=4.0)
    return b"".join(msgspec.json.encode(line) + b"\n" for line in (begun, kept))


@functools.cache
def _keys() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        make_keys(Path(folder), operators=["alice"], robots=[])
        return {path.name: path.read_bytes() for path in Path(folder).rglob("*.*") if path.is_file()}


def _read_authority(path: Path) -> None:
    """Read the authority's key and certificate, of which one is as it should be."""
    other = {"ca.key": "ca.pem", "ca.pem": "ca.key"}[path.name]
    (path.parent / other).write_bytes(_keys()[other])
    _authority(path.parent, _MADE)


def _read_truth(path: Path) -> None:
    recorded._of_bench(recorded.RecordedTrial("p01-t01", 1, 1, "bag", 0, 300_000_000, 0, path.parent))


_TRUTH = b"t_s,object_height_m,slip_m,deformation_m\n0.1,0.0,0.0,0.0\n0.2,0.1,0.001,0.002\n0.3,0.2,0.0,0.0\n"
_OBJECTS = b'[bag]\nmass_g = 32.0\nmeasured = "scales"\nphoto = "objects/bag.jpg"\n'
_LIGHT = b"t_ns,on\n" + b"".join(b"%d,%d\n" % (1000 * k, k % 2) for k in range(1, 9))
_BOARD = msgspec.json.encode(SessionBoard(t_ns=5, phase="rest", says="waits"))
_TIMES = b"picture,t_ns\n0,100\n1,200\n2,300\n"
_STATED = b'version = "0.1.0"\nparameters_sha256 = ""\npreset = "live"\n'
_PERSON = b"[hand]\nwide = { mean = 1.0, sd = 0.2, source = 'a test', unit = 'mm' }\n"
_TOUCH = b"t_s,finger,in_contact,eda,mass,peak,x,y\n0.1,thumb,1,9,1.5,2.5,3.0,4.0\n0.2,thumb,0,0,0,0,0,0\n"
_HAND = b"t_s,level,closure,height_m\n0.1,1,1.0,0.2\n0.2,,,\n"
_FACTS = b'{"trial": "p01-t01", "attempt": 1, "started_ns": 5, "zero_ns": 3}'
_FORCES = b"img_name,force_n\nframe_0.png,1.5\nframe_1.png,2.5\n"
_COURSE_OF_FORCE = b"t_s,force_n\n0.1,1.5\n0.2,2.5\n"
_MARKS = b"img_name,center_x,center_y,radius\nframe_0.png,10,20,5\nframe_1.png,11,21,6\n"


def _write_fitts(path: Path) -> None:
    row = (0.25, 0.1, 0.5, 0.2, 0.45, 0.5, 1.2, 0.4, 0.0, 0.0)
    record = FittsRecord(
        made=_MADE, device="tty", driver="cyton", person="p01", preset="live", decoder="rules", seed=1, dwell_s=1.0,
        timeout_s=10.0, cursor_step=0.25, throughput_bits_s=1.0, completion_percent=100.0, overshoots=0.0,
        movements=(row,),
    )  # fmt: skip
    write_record(record, path)


def _take_commands(path: Path) -> None:
    there = path.with_name("taken.jsonl")
    there.unlink(missing_ok=True)
    commands = CommandFile(there, ManualClock())
    os.link(path, there, follow_symlinks=False)
    commands.take()


def _of_package(package: str, name: str) -> Callable[[Path], bytes]:
    return lambda _: (files(package) / name).read_bytes()


_BAG = _file("a.mcap", _write_bag)
# Of each kind, as READERS.
GUEST_READERS: dict[str, Reader] = {
    "model of a decoder": ("model.json", lambda _: _model(), load_model),
    "samples of a practice": _written(
        "r.npy", lambda p: keep_tracked(np.arange(60.0).reshape(20, 3), p.with_suffix(".toml")), _read_tracked
    ),
    "ROS 2 pictures": ("a.mcap", _BAG, lambda p: _read_all(Ros2Pictures(Ros2PicturesOptions(file=p)))),
    "ROS 2 arrays": ("a.mcap", _BAG, lambda p: _read_all(Ros2Emg(Ros2EmgOptions(file=p)))),
    "marks": ("marks.csv", lambda _: _MARKS, read_marks),
    "journal": _written("events.jsonl", _write_journal, read_events),
    "key of clips": ("r1.json", lambda _: _CLIPS, clips.decode_key),
    "study": ("study.toml", _plan("study.toml"), _read_plan),
    "plan": ("plan.csv", _plan("plan.csv"), _read_plan),
    "session in one file": _written("p01.zip", _write_bundle, _open_bundle),
    "objects of a study": ("objects.toml", lambda _: _OBJECTS, lambda p: read_objects(p.parent)),
    "lens of a camera": _written(
        "lens.json", lambda p: save_lens(p, Lens(640, 480, 500.0, 500.0, 320.0, 240.0)), load_lens
    ),
    "tags of a scene": _written("tags.toml", lambda p: save_layout(p, example_layout()), load_layout),
    "time code of a video": ("a.csv", lambda _: _TIMES, read_times),
    "assumptions": ("simulation.toml", lambda _: _STATED, lambda p: read_assumptions(p.parent)),
    "parameters": ("parameters.toml", lambda _: _PERSON, lambda p: read_parameters(p.parent)),
    "course of a trial": _written("course.csv", _write_course, read_course),
    "touch of a trial": ("touch.csv", lambda _: _TOUCH, read_touch),
    "hand of a trial": ("hand.csv", lambda _: _HAND, read_hand),
    "facts of a trial": (
        "trial.json",
        lambda _: _FACTS,
        lambda p: recorded._begins(p.parent, "p01-t01", 1, 5),
    ),
    "picture of touch": _written("touch.npz", _write_picture, read_touch_picture),
    "forces": ("forces.csv", lambda _: _FORCES, read_forces),
    "course of force": ("forces.csv", lambda _: _COURSE_OF_FORCE, read_forces),
    "episodes": ("episodes.jsonl", lambda _: _episodes(), lambda p: read_episodes(p.parent)),
    "simulated trials": ("results.jsonl", lambda _: _results(), read_results),
    "log of bursts": ("bursts.json", lambda _: _onset_log(), read_log),
    "sound": _written("a.wav", lambda p: write_wav(p, np.sin(np.arange(400) / 9), 8000), read_wav),
    "truth of a trial": ("truth.csv", lambda _: _TRUTH, _read_truth),
    "certificate of a station": ("station.pem", lambda _: _keys()["station.pem"], lambda p: expiry(p.parent)),
    "certificate of the authority": ("ca.pem", lambda _: _keys()["ca.pem"], _read_authority),
    "key of the authority": ("ca.key", lambda _: _keys()["ca.key"], _read_authority),
    "video of a scene": _written("front.mp4", _write_mp4, lambda p: list(islice(read_pictures(p), 51))),
    "recording of a scene": _written(
        "scene.mcap", _write_scene, lambda p: export_camera(p, "front", p.parent / "out.mp4")
    ),
    "record of a Fitts test": _written("f.toml", _write_fitts, lambda p: read_record(p, FittsRecord).score()),
    "people's numbers": ("people.toml", _of_package("tega_sim.operator", "parameters.toml"), load_parameters),
    "simulated objects": ("things.toml", _of_package("tega_sim.world", "objects.toml"), read_simulated),
    "moments of a light": ("flashes.csv", lambda _: _LIGHT, read_flashes),
    "delays of scene cameras": (
        "scene.offsets.json",
        lambda _: b'{"front": {"late_s": 0.05, "error_s": 0.002, "n_edges": 12}}',
        lambda p: read_offsets(p.with_name("scene.mcap")),
    ),
    "board of a session": ("now.json", lambda _: _BOARD, read_board),
    "commands to a session": ("told.jsonl", lambda _: 3 * b'{"do": "mark"}\n', _take_commands),
}


# What is passed over where it is damaged, so that nothing tells of a pipe there.
_NEEDLESS = {"board of a session", "commands to a session"}
_TOLD = [kind for kind in GUEST_READERS if kind not in _NEEDLESS]


@pytest.mark.parametrize("kind", GUEST_READERS)
def test_whatever_a_file_holds_only_errors_of_tega_come_of_it(kind: str, tmp_path: Path) -> None:
    ends_with_errors_however_mutated(GUEST_READERS[kind], tmp_path)


@pytest.mark.parametrize("kind", _TOLD)
def test_what_is_no_file_and_a_far_too_large_one_are_refused_at_once(kind: str, tmp_path: Path) -> None:
    refuses_what_is_no_file(GUEST_READERS[kind], tmp_path)
    (tmp_path / GUEST_READERS[kind][0]).unlink()
    if kind != "recording of a scene":  # which may be as large as the disk
        refuses_a_huge_file(GUEST_READERS[kind], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ROS 2 pictures", "ROS 2 arrays"])
@pytest.mark.parametrize("n", [250, pytest.param(10_000, marks=pytest.mark.deep)])
def test_a_bag_that_is_mutated_often_ends_with_an_error_of_tega(kind: str, n: int, tmp_path: Path) -> None:
    ends_with_errors_however_mutated(GUEST_READERS[kind], tmp_path, n)


def _scene_at(path: Path) -> None:
    bus = Bus()
    bus.subscribe(DisplayPicture, lambda _one: None)
    file = followed_scene(path, bus, start_ns=0, end_ns=3_000_000_000)
    for n, at_ns in enumerate((0, 1_400_000_000, 300_000_000, 2_900_000_000)):
        file.follow(PlayedMoment(n, at_ns, 0), threading.Event())


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    film = packets([k * 50_000_000 for k in range(40)])
    return write_scene(tmp_path_factory.mktemp("scene") / "scene.mcap", {"front": film, "side": film[:20]})


@FEW
@given(changes=st.lists(CHANGE, max_size=4), spot=SPOT, whole=st.booleans())
def test_a_scene_recording_that_is_odd_is_told_to_be(scene, changes, spot, whole, tmp_path):
    path = tmp_path / "odd.mcap"
    if whole:
        odd(scene, path, spot, changes, {"message"})
    else:
        path.write_bytes(mutated(scene.read_bytes(), changes))
    with contextlib.suppress(TegaError):
        _scene_at(path)
