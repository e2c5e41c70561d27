"""Make a valid file of every format that TEGA reads, each beside what reads it."""

from __future__ import annotations

import functools
import gzip
import hashlib
import io
import json
import re
import shutil
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import scipy.io

from reference.can_logs import conversation, write_log
from reference.foreign_records import RECORD_READERS
from reference.recordings import pressed, write_video
from reference.ros2 import BEGIN_NS, write_bag
from reference.ros2 import array as ros2_array
from reference.ros2 import raw as ros2_raw
from reference.videos import encode, numbered
from tega.config import load_config
from tega.config.calibration import Calibration, FingerMaxima, load_calibration, save_calibration
from tega.config.calibration.folder import CalibrationFolder, Unfinished
from tega.config.calibration.records import TouchRecord, read_record
from tega.devices.emg.ros2_emg import Ros2Emg, Ros2EmgOptions
from tega.devices.fingertip.picture_stack import StackFile, StackFileOptions
from tega.devices.fingertip.ros2_pictures import Ros2Pictures, Ros2PicturesOptions
from tega.devices.fingertip.video import VideoFile, VideoFileOptions
from tega.devices.hand.can_log import read_can_log
from tega.devices.hand.hand_log import HandLog, find_hand
from tega.devices.tracker.sources.recorded import read_poses
from tega.hand.poses import load_poses
from tega.recording.annotations import AnnotationFile, annotations_path, read_annotations
from tega.recording.folder import prepare_folder
from tega.recording.mcap_folder import SessionFolder
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.boris import read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.signals import read_signals
from tega.runtime.opencv import read_image
from tega.safety import dose_file
from tega_bench.vest_latency.log import OnsetLog, read_log, read_wav, write_wav
from tega_figures.audit import read_marks
from tega_figures.audit.truth import read_forces
from tega_link.keys import _authority, expiry, make_keys
from tega_scene.layout import example_layout, load_layout, save_layout
from tega_scene.lens import Lens, load_lens, save_lens
from tega_scene.pictures import read_pictures, read_times
from tega_scene.record import export_camera, record_cameras
from tega_sim.plan import TrialResult
from tega_sim.score import TrialEvent
from tega_sim.trials import read_results
from tega_study.bundle import open_bundle, write_bundle
from tega_study.coupling import TouchCourse, read_course, write_course
from tega_study.episodes.journal import EpisodeLine, read_episodes
from tega_study.hand_rows import read_hand
from tega_study.journal import Journal, events_path, read_events
from tega_study.objects import read_objects
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.score import clips, recorded, trial_pictures
from tega_study.silico.assumptions import read_assumptions, read_parameters
from tega_study.touch_picture import read_touch_picture
from tega_study.touch_rows import read_touch


def _read_video(path: Path) -> None:
    with VideoFile(VideoFileOptions(file=path)) as video:
        for _ in range(50):
            if video.read(0.0) is None:
                return


def _encoded_video(path: Path, codec: str) -> bytes:
    return encode(path, numbered(4), [0, 30, 90, 120], codec=codec).read_bytes()


def _bag(folder: Path) -> bytes:
    messages: list[Any] = []
    for k in range(4):
        t_ns = BEGIN_NS + k * 30_000_000
        picture = pressed(0.5, noise=k)
        messages.append(("/gel", "image", t_ns, ros2_raw(picture, "rgb8", t_ns)))
        messages.append(
            ("/emg", "array", t_ns, ros2_array(np.ones((2, 3), np.float32), ("samples", "channels")))
        )
    return write_bag(folder / "a.mcap", messages).read_bytes()


def _read_all(source: Any) -> None:
    with source:
        while source.read(0.0) is not None:
            pass


def _log(path: Path) -> bytes:
    return write_log(path, conversation([[k] * 16 for k in range(3)])).read_bytes()


def _decode_log(path: Path) -> None:
    log = HandLog(*find_hand(read_can_log(path), device_id=None, channel=None))
    for _ in log.states(read_can_log(path)):
        pass


def _read_stack(path: Path) -> None:
    with StackFile(StackFileOptions(file=path)) as stack:
        for _ in range(50):
            if stack.read(0.0) is None:
                return


def _npz() -> bytes:
    file = io.BytesIO()
    pictures = np.stack([pressed(0.5, noise=k) for k in range(3)])
    np.savez_compressed(file, pictures=pictures, t_s=np.array([0.0, 0.5, 0.7]))
    return file.getvalue()


def toml() -> bytes:
    return b'[session]\npreset = "paper"\nout_dir = "results"\n\n[safety]\nemg_lost_ms = 500\n'


def _calibration(folder: Path) -> bytes:
    save_calibration(Calibration(preset="live", origin="a test", tactile=FingerMaxima()), folder / "c.toml")
    return (folder / "c.toml").read_bytes()


def _encoded(suffix: str) -> bytes:
    data: bytes = cv2.imencode(suffix, pressed(0.5, noise=1))[1].tobytes()
    return data


def npy(array: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _mat() -> bytes:
    file = io.BytesIO()
    scipy.io.savemat(file, {"emg": np.arange(60.0).reshape(20, 3)}, do_compression=True)
    return file.getvalue()


def _journal(folder: Path) -> bytes:
    with Journal(folder / "events.jsonl") as journal:
        for trial in range(3):
            journal.add("trial_start", t_ns=trial * 10, trial=trial + 1)
            journal.add("trial_end", t_ns=trial * 10 + 5, trial=trial + 1, status="done", success=True)
    return (folder / "events.jsonl").read_bytes()


def _elan(folder: Path) -> bytes:
    events = [CodedEvent(1.0, "thumb", "slip", ("long",), "x", 0.5), CodedEvent(2.0, "", "drop")]
    write_eaf(folder / "a.eaf", {"r1": events}, codes=["slip"], media="a.mp4")
    return (folder / "a.eaf").read_bytes()


def _annotations(folder: Path) -> bytes:
    with AnnotationFile(folder / "a.mcap", "r1") as file:
        for t_s in (1.0, 2.0, 3.0):
            file.press("deformation", t_s, is_state=True)
        file.undo()
    return annotations_path(folder / "a.mcap").read_bytes()


def _boris() -> bytes:
    event = [1.5, "", "slip", "", ""]
    return json.dumps({"observations": {"p01-t01_r1": {"events": [event, event]}}}).encode()


_CLIPS = b"""{"format": "tega-clips", "version": 1, "plan": "0", "rater": "r1", "proposed": true, "clips": [
{"name": "clip-001", "participant": "p01", "trial": 1, "attempt": 1, "length_s": 1.3,
"proposals": [{"source": "rule", "kind": "slip", "t_s": 0.5, "confidence": 1.0}]}], "left_out": []}"""


def _plan(name: str) -> Callable[[Path], bytes]:
    def made(folder: Path) -> bytes:
        write_plan(make_plan(participants=2, seed=1, objects=["bottle"], trials=2), folder / "study")
        return (folder / "study" / name).read_bytes()

    return made


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


def _course(folder: Path) -> bytes:
    t_s = np.arange(1, 20) / 30
    write_course(folder / "course.csv", TouchCourse(t_s, t_s, t_s, np.round(t_s)))
    return (folder / "course.csv").read_bytes()


def _picture_of_touch() -> bytes:
    file = io.BytesIO()
    frame, baseline = pressed(0.5, noise=1), pressed(0.0, noise=1)
    np.savez(file, finger="thumb", preset="paper", baseline=baseline, frame=frame, maxima=[1.0, 9000.0])
    return file.getvalue()


def _bundle(folder: Path) -> bytes:
    study = folder / "study"
    write_plan(make_plan(participants=2, seed=1, objects=["bottle"], trials=2), study)
    events = events_path(study, "p01")
    events.parent.mkdir(parents=True)
    events.write_bytes(_journal(folder))
    write_bundle(study, "p01", folder / "p01.zip")
    return (folder / "p01.zip").read_bytes()


def _open_bundle(path: Path) -> None:
    opened = path.parent / "opened"
    try:
        open_bundle(path, opened)
    finally:
        shutil.rmtree(opened, ignore_errors=True)


def _lens(folder: Path) -> bytes:
    save_lens(folder / "lens.json", Lens(640, 480, 500.0, 500.0, 320.0, 240.0))
    return (folder / "lens.json").read_bytes()


def _layout(folder: Path) -> bytes:
    save_layout(folder / "tags.toml", example_layout())
    return (folder / "tags.toml").read_bytes()


def _scene(folder: Path) -> bytes:
    film = cv2.VideoWriter(str(folder / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 64))
    for shade in (40, 80, 120):
        film.write(np.full((64, 64, 3), shade, np.uint8))
    film.release()
    cameras = {"front": str(folder / "film.avi")}
    record_cameras(folder / "scene.mcap", cameras, size=(64, 64), rate_hz=30, stop=lambda: False)
    return (folder / "scene.mcap").read_bytes()


def _mp4(folder: Path) -> bytes:
    _scene(folder)
    export_camera(folder / "scene.mcap", "front", folder / "front.mp4")
    return (folder / "front.mp4").read_bytes()


def _read_pictures(path: Path) -> None:
    for number, _ in enumerate(read_pictures(path)):
        if number == 50:
            return


def _wav(folder: Path) -> bytes:
    write_wav(folder / "a.wav", np.sin(np.arange(400) / 9), 8000)
    return (folder / "a.wav").read_bytes()


_MADE = datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC)


def _onset_log() -> bytes:
    log = OnsetLog(
        made=_MADE, driver="vest", device="v", layout="x40", motor=2, percent=60, on_s=0.5, bursts_s=(0.8,)
    )
    return msgspec.json.encode(log)


def _results() -> bytes:
    result = TrialResult(
        object="bag", success=True, slips=1, deformations=0, drops=0, duration_s=9.5, peak_force_n=3.0,
        lift_off_s=2.0, lifted_s=4.0, slid_m=0.001, deformation_m=0.0, mean_level=2.5,
        events=(TrialEvent("slip", 3.0, 0.004),), simulated_s=20.0,
    )  # fmt: skip
    return 2 * (msgspec.json.encode(result) + b"\n")


def _episodes() -> bytes:
    lines = [
        EpisodeLine(1, "begun", 5.0, "trial-001.mcap", "lift"),
        EpisodeLine(1, "kept", 9.5, duration_s=4.0),
    ]
    return b"".join(msgspec.json.encode(line) + b"\n" for line in lines)


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


def _note_trial(path: Path) -> None:
    SessionFolder(path.parent).note("trial-001.mcap", {"task": "lift"})


def _read_unfinished(path: Path) -> None:
    home = CalibrationFolder(path.parent / "kept")
    home.person("p01").mkdir(parents=True, exist_ok=True)
    shutil.copy(path, home.person("p01") / "unfinished.json")
    home.unfinished("p01", _MADE)


def _read_truth(path: Path) -> None:
    trial = recorded.RecordedTrial("p01-t01", 1, 1, "bag", 0, 300_000_000, 0, path.parent)
    trial_pictures._of_bench(trial)


_INDEX = (
    b'{"format": "tega-session", "version": 1, "trials": [{"file": "trial-001.mcap", "state": "complete"}]}'
)
_TRUTH = b"t_s,object_height_m,slip_m,deformation_m\n0.1,0.0,0.0,0.0\n0.2,0.1,0.001,0.002\n0.3,0.2,0.0,0.0\n"
_DOSE = json.dumps([{"ended_s": 5.0, "dose_s": [1.5] * 40, "heat": [0.2] * 40}]).encode()

_OBJECTS = b'[bag]\nmass_g = 32.0\nmeasured = "scales"\nphoto = "objects/bag.jpg"\n'
_TIMES = b"picture,t_ns\n0,100\n1,200\n2,300\n"
_STATED = b'version = "0.1.0"\nparameters_sha256 = ""\npreset = "live"\n'
_PERSON = b"[hand]\nwide = { mean = 1.0, sd = 0.2, source = 'a test', unit = 'mm' }\n"
_TOUCH = b"t_s,finger,in_contact,eda,mass,peak,x,y\n0.1,thumb,1,9,1.5,2.5,3.0,4.0\n0.2,thumb,0,0,0,0,0,0\n"
_HAND = b"t_s,level,closure,height_m\n0.1,1,1.0,0.2\n0.2,,,\n"
_FACTS = b'{"trial": "p01-t01", "attempt": 1, "started_ns": 5, "zero_ns": 3}'
_FORCES = b"img_name,force_n\nframe_0.png,1.5\nframe_1.png,2.5\n"
_COURSE_OF_FORCE = b"t_s,force_n\n0.1,1.5\n0.2,2.5\n"

_POSES = b"t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0.0,0.1,0.2,0.3,1,0,0,0\n0.1,0.1,0.2,0.3,1,0,0,0\n"
_EVENTS = b"Observation id,Behavior,Time\np01-t01,slip,1.5\np01-t01,drop,2.5\n"
_AGGREGATED = (
    b"Observation id;Behavior;Behavior type;Start (s);Stop (s);Modifier #1;Comment start\n"
    b"p01;slip;STATE;1,5;2,5;long;x\np01;drop;POINT;3,5;NA;;\n"
)
_MARKS = b"img_name,center_x,center_y,radius\nframe_0.png,10,20,5\nframe_1.png,11,21,6\n"

# Of each kind: the file's name, what makes a valid one, what reads it.
READERS: dict[str, tuple[str, Callable[[Path], bytes], Callable[[Path], object]]] = {
    "settings": ("lab.toml", lambda _: toml(), lambda p: load_config(p, environ={})),
    "calibration": ("c.toml", _calibration, load_calibration),
    "record": (
        "r.toml",
        lambda _: b"version = 1\nmade = 2026-11-21T15:04:05Z\n",
        lambda p: read_record(p, TouchRecord),
    ),
    "poses of the hand": ("poses.toml", lambda _: b"[level-1]\nindex = [0, 0, 0, 0]\n", load_poses),
    "poses": ("poses.csv", lambda _: _POSES, read_poses),
    "marks": ("marks.csv", lambda _: _MARKS, read_marks),
    "EMG table": ("emg.csv", lambda _: b"a,b,c\n1,2,3\n4,5,6.5\n7,8,9e3\n", read_signals),
    "EMG npy": ("emg.npy", lambda _: npy(np.arange(60.0).reshape(20, 3)), read_signals),
    "EMG mat": ("emg.mat", lambda _: _mat(), read_signals),
    "PNG": ("a.png", lambda _: _encoded(".png"), lambda p: read_image(p, driver="images")),
    "JPEG": ("a.jpg", lambda _: _encoded(".jpg"), lambda p: read_image(p, driver="images")),
    "BMP": ("a.bmp", lambda _: _encoded(".bmp"), lambda p: read_image(p, driver="images")),
    "picture npy": ("a.npy", lambda _: npy(pressed(0.5, noise=1)), lambda p: read_image(p, driver="images")),
    "stack npy": ("a.npy", lambda _: npy(np.stack([pressed(0.5, noise=k) for k in range(3)])), _read_stack),
    "stack npz": ("a.npz", lambda _: _npz(), _read_stack),
    "journal": ("events.jsonl", _journal, read_events),
    "BORIS project": ("a.boris", lambda _: _boris(), read_boris),
    "BORIS project packed": ("a.boris.gz", lambda _: gzip.compress(_boris()), read_boris),
    "BORIS aggregated": ("a.tsv", lambda _: _AGGREGATED, read_boris),
    "ELAN": ("a.eaf", _elan, lambda p: read_eaf(p, ["slip"])),
    "annotations": ("a.annotations.jsonl", _annotations, lambda p: read_annotations(p.with_name("a.mcap"))),
    "key of clips": ("r1.json", lambda _: _CLIPS, clips.decode_key),
    "BORIS table": ("a.csv", lambda _: _EVENTS, read_boris),
    "study": ("study.toml", _plan("study.toml"), _read_plan),
    "plan": ("plan.csv", _plan("plan.csv"), _read_plan),
    "session in one file": ("p01.zip", _bundle, _open_bundle),
    "objects of a study": ("objects.toml", lambda _: _OBJECTS, lambda p: read_objects(p.parent)),
    "lens of a camera": ("lens.json", _lens, load_lens),
    "tags of a scene": ("tags.toml", _layout, load_layout),
    "time code of a video": ("a.csv", lambda _: _TIMES, read_times),
    "assumptions": ("simulation.toml", lambda _: _STATED, lambda p: read_assumptions(p.parent)),
    "parameters": ("parameters.toml", lambda _: _PERSON, lambda p: read_parameters(p.parent)),
    "course of a trial": ("course.csv", _course, read_course),
    "touch of a trial": ("touch.csv", lambda _: _TOUCH, read_touch),
    "hand of a trial": ("hand.csv", lambda _: _HAND, read_hand),
    "facts of a trial": (
        "trial.json",
        lambda _: _FACTS,
        lambda p: recorded._begins(p.parent, "p01-t01", 1, 5),
    ),
    "picture of touch": ("touch.npz", lambda _: _picture_of_touch(), read_touch_picture),
    "forces": ("forces.csv", lambda _: _FORCES, read_forces),
    "course of force": ("forces.csv", lambda _: _COURSE_OF_FORCE, read_forces),
    "index of a session": ("session.json", lambda _: _INDEX, _note_trial),
    "summary of a run": (
        "summary.json",
        lambda _: b'{"format": "tega-run", "version": 1, "ended": "complete"}',
        lambda p: prepare_folder(p.parent),
    ),
    "episodes": ("episodes.jsonl", lambda _: _episodes(), lambda p: read_episodes(p.parent)),
    "unfinished calibration": (
        "unfinished.json",
        lambda _: msgspec.json.encode(Unfinished(started=_MADE, devices={"emg": "tty"}, steps={"emg": "x"})),
        _read_unfinished,
    ),
    "dose of a day": ("vest-dose.json", lambda _: _DOSE, dose_file._read),
    "simulated trials": ("results.jsonl", lambda _: _results(), read_results),
    "log of bursts": ("bursts.json", lambda _: _onset_log(), read_log),
    "sound": ("a.wav", _wav, read_wav),
    "truth of a trial": ("truth.csv", lambda _: _TRUTH, _read_truth),
    "certificate of a station": ("station.pem", lambda _: _keys()["station.pem"], lambda p: expiry(p.parent)),
    "certificate of the authority": ("ca.pem", lambda _: _keys()["ca.pem"], _read_authority),
    "key of the authority": ("ca.key", lambda _: _keys()["ca.key"], _read_authority),
    "video of a scene": ("front.mp4", _mp4, _read_pictures),
    "recording of a scene": (
        "scene.mcap",
        _scene,
        lambda p: export_camera(p, "front", p.parent / "out.mp4"),
    ),
    "video": ("a.avi", lambda folder: write_video(folder / "v.avi", 4).read_bytes(), _read_video),
    "ROS 2 pictures": ("a.mcap", _bag, lambda p: _read_all(Ros2Pictures(Ros2PicturesOptions(file=p)))),
    "ROS 2 arrays": ("a.mcap", _bag, lambda p: _read_all(Ros2Emg(Ros2EmgOptions(file=p)))),
    "log .asc": ("a.asc", lambda folder: _log(folder / "a.asc"), _decode_log),
    "log .blf": ("a.blf", lambda folder: _log(folder / "a.blf"), _decode_log),
    "log .log": ("a.log", lambda folder: _log(folder / "a.log"), _decode_log),
    "log .trc": ("a.trc", lambda folder: _log(folder / "a.trc"), _decode_log),
    "video AV1": ("a.mp4", lambda folder: _encoded_video(folder / "v.mp4", "av1"), _read_video),
    "video H.264": ("a.mkv", lambda folder: _encoded_video(folder / "v.mkv", "h264"), _read_video),
    "video VP9": ("a.webm", lambda folder: _encoded_video(folder / "v.webm", "vp9"), _read_video),
} | RECORD_READERS
