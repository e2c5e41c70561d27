"""Make a valid file of every format that the core of TEGA reads, each beside what reads it."""

from __future__ import annotations

import gzip
import io
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import scipy.io

from reference.kept import NOW
from reference.recordings import pressed, write_video
from reference.videos import encode, numbered
from tega.config import load_config
from tega.config.calibration import Calibration, load_calibration, save_calibration
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import TouchRecord, read_record
from tega.devices.fingertip.picture_stack import StackFile, StackFileOptions
from tega.devices.fingertip.video import VideoFile, VideoFileOptions
from tega.devices.tracker.sources import read_poses
from tega.devices.vest.player_versions import PlayerOptions, versions_to_ask
from tega.hand.poses import load_poses
from tega.loop import worn_vest
from tega.recording.annotations import AnnotationFile, annotations_path, read_annotations
from tega.recording.mcap_folder import SessionFolder
from tega.recording.run_tables import prepare_folder
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.boris import read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega.runtime.files.signals import read_signals
from tega.runtime.opencv import read_image
from tega.setup.calibration.sitting import Unfinished, unfinished

Reader = tuple[str, Callable[[Path], bytes], Callable[[Path], object]]


def _read_hand(path: Path) -> None:
    home = CalibrationFolder(path.parent / "kept")
    home.person("p01").mkdir(parents=True, exist_ok=True)
    there = home.person("p01") / path.name
    there.unlink(missing_ok=True)
    os.link(path, there, follow_symlinks=False)  # pipes and sockets as well
    home.hand("p01")


def _read_pictures(source: Any) -> None:
    with source:
        for _ in range(50):
            if source.read(0.0) is None:
                return


def _read_video(path: Path) -> None:
    _read_pictures(VideoFile(VideoFileOptions(file=path)))


def _read_stack(path: Path) -> None:
    _read_pictures(StackFile(StackFileOptions(file=path)))


def _encoded_video(path: Path, codec: str) -> bytes:
    return encode(path, numbered(4), [0, 30, 90, 120], codec=codec).read_bytes()


def _npz() -> bytes:
    file = io.BytesIO()
    pictures = np.stack([pressed(0.5, noise=k) for k in range(3)])
    np.savez_compressed(file, pictures=pictures, t_s=np.array([0.0, 0.5, 0.7]))
    return file.getvalue()


def toml() -> bytes:
    return b'[session]\npreset = "paper"\nout_dir = "results"\n\n[safety]\nemg_lost_ms = 500\n'


def _calibration(folder: Path) -> bytes:
    save_calibration(Calibration(preset="live", origin="a test"), folder / "c.toml")
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
    scipy.io.savemat(file, {"emg": _SAMPLES}, do_compression=True)
    return file.getvalue()


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


def _note_trial(path: Path) -> None:
    SessionFolder(path.parent).note("trial-001.mcap", {"task": "lift"})


_SAMPLES = np.arange(60.0).reshape(20, 3)
_INDEX = (
    b'{"format": "tega-session", "version": 1, "trials": [{"file": "trial-001.mcap", "state": "complete"}]}'
)
_DOSE = json.dumps([{"ended_s": 5.0, "dose_s": [1.5] * 40, "heat": [0.2] * 40}]).encode()
_POSES = b"t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0.0,0.1,0.2,0.3,1,0,0,0\n0.1,0.1,0.2,0.3,1,0,0,0\n"
_EVENTS = b"Observation id,Behavior,Time\np01-t01,slip,1.5\np01-t01,drop,2.5\n"
_AGGREGATED = (
    b"Observation id;Behavior;Behavior type;Start (s);Stop (s);Modifier #1;Comment start\n"
    b"p01;slip;STATE;1,5;2,5;long;x\np01;drop;POINT;3,5;NA;;\n"
)


# Of each kind: the file's name, what makes a valid one, what reads it.
READERS: dict[str, Reader] = {
    "settings": ("lab.toml", lambda _: toml(), lambda p: load_config(p, environ={})),
    "calibration": ("c.toml", _calibration, load_calibration),
    "record": (
        "r.toml",
        lambda _: b"version = 1\nmade = 2026-11-21T15:04:05Z\n",
        lambda p: read_record(p, TouchRecord),
    ),
    "poses of the hand": ("poses.toml", lambda _: b"[level-1]\nindex = [0, 0, 0, 0]\n", load_poses),
    "poses": ("poses.csv", lambda _: _POSES, read_poses),
    "EMG table": ("emg.csv", lambda _: b"a,b,c\n1,2,3\n4,5,6.5\n7,8,9e3\n", read_signals),
    "EMG npy": ("emg.npy", lambda _: npy(_SAMPLES), read_signals),
    "EMG mat": ("emg.mat", lambda _: _mat(), read_signals),
    "PNG": ("a.png", lambda _: _encoded(".png"), lambda p: read_image(p, driver="images")),
    "JPEG": ("a.jpg", lambda _: _encoded(".jpg"), lambda p: read_image(p, driver="images")),
    "BMP": ("a.bmp", lambda _: _encoded(".bmp"), lambda p: read_image(p, driver="images")),
    "picture npy": ("a.npy", lambda _: npy(pressed(0.5, noise=1)), lambda p: read_image(p, driver="images")),
    "stack npy": ("a.npy", lambda _: npy(np.stack([pressed(0.5, noise=k) for k in range(3)])), _read_stack),
    "stack npz": ("a.npz", lambda _: _npz(), _read_stack),
    "BORIS project": ("a.boris", lambda _: _boris(), read_boris),
    "BORIS project packed": ("a.boris.gz", lambda _: gzip.compress(_boris()), read_boris),
    "BORIS aggregated": ("a.tsv", lambda _: _AGGREGATED, read_boris),
    "ELAN": ("a.eaf", _elan, lambda p: read_eaf(p, ["slip"])),
    "annotations": ("a.annotations.jsonl", _annotations, lambda p: read_annotations(p.with_name("a.mcap"))),
    "BORIS table": ("a.csv", lambda _: _EVENTS, read_boris),
    "index of a session": ("session.json", lambda _: _INDEX, _note_trial),
    "summary of a run": (
        "summary.json",
        lambda _: b'{"format": "tega-run", "version": 1, "ended": "complete"}',
        lambda p: prepare_folder(p.parent),
    ),
    "unfinished calibration": (
        "unfinished.json",
        lambda _: msgspec.json.encode(Unfinished(started=NOW, devices={"emg": "tty"}, steps={"emg": "x"})),
        lambda p: unfinished(p, NOW),
    ),
    "dose of a day": ("vest-dose.json", lambda _: _DOSE, lambda p: worn_vest._of_the_day(p, 0.0)),
    "video": ("a.avi", lambda folder: write_video(folder / "v.avi", 4).read_bytes(), _read_video),
    "video AV1": ("a.mp4", lambda folder: _encoded_video(folder / "v.mp4", "av1"), _read_video),
    "video H.264": ("a.mkv", lambda folder: _encoded_video(folder / "v.mkv", "h264"), _read_video),
    "video VP9": ("a.webm", lambda folder: _encoded_video(folder / "v.webm", "vp9"), _read_video),
    "hand of a person": ("person.toml", lambda _: b'hand = "left"\n', _read_hand),
    "key of the Player": (
        "key.txt",
        lambda _: b"0123456789abcdef\n",
        lambda p: versions_to_ask(PlayerOptions(version="3", app_id="tega", api_key_file=p)),
    ),
}
