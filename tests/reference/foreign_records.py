"""Make a valid file of each kind that is kept of a person, a decoder or a simulation, each beside what reads it."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

import msgspec
import numpy as np

from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import PracticeRecord, read_record, write_record
from tega.devices.vest.player_settings import PlayerOptions, versions_to_ask
from tega.runtime.clock import ManualClock
from tega.setup.calibration.tracked import keep_tracked, read_tracked
from tega.stages.learned import fit
from tega.stages.learned.model import load_model
from tega_practice.kept import FittsRecord
from tega_scene.offset import read_flashes
from tega_scene.offset_file import read_offsets
from tega_sim.operator import load_parameters
from tega_sim.world.objects import read_objects
from tega_study.lead.status_file import SessionBoard, read_board
from tega_study.lead.tell import CommandFile

_MADE = datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC)


@functools.cache
def _model() -> bytes:
    rng, target = np.random.default_rng(1), np.tile(np.repeat([0.0, 1.0], 200), 8)
    samples = rng.normal(size=(len(target), 1)) * (5 + 50 * target[:, None])
    made = fit(samples, target, rate_hz=200, tau=20, kind="raw")
    return msgspec.json.encode(made.model)


def _practice() -> PracticeRecord:
    return PracticeRecord(
        made=_MADE, device="tty", driver="cyton", person="p01", preset="live", seed=1, duration_s=0.1,
        in_target_percent=50.0, rms_error_levels=0.5, kind="raw", rate_hz=200.0, channels=("a", "b"),
    )  # fmt: skip


def _tracked(folder: Path) -> bytes:
    return keep_tracked(np.arange(60.0).reshape(20, 3), folder / "r.toml").read_bytes()


def _read_tracked(path: Path) -> None:
    write_record(_practice(), path.with_suffix(".toml"))
    read_tracked(path.with_suffix(".toml"))


def _fitts(folder: Path) -> bytes:
    row = (0.25, 0.1, 0.5, 0.2, 0.45, 0.5, 1.2, 0.4, 0.0, 0.0)
    record = FittsRecord(
        made=_MADE, device="tty", driver="cyton", person="p01", preset="live", decoder="rules", seed=1, dwell_s=1.0,
        timeout_s=10.0, cursor_step=0.25, throughput_bits_s=1.0, completion_percent=100.0, overshoots=0.0,
        movements=(row,),
    )  # fmt: skip
    write_record(record, folder / "f.toml")
    return (folder / "f.toml").read_bytes()


def _read_hand(path: Path) -> None:
    home = CalibrationFolder(path.parent / "kept")
    home.person("p01").mkdir(parents=True, exist_ok=True)
    there = home.person("p01") / path.name
    there.unlink(missing_ok=True)
    os.link(path, there, follow_symlinks=False)  # pipes and sockets as well
    home.hand("p01")


def _take_commands(path: Path) -> None:
    there = path.with_name("taken.jsonl")
    there.unlink(missing_ok=True)
    commands = CommandFile(there, ManualClock())
    os.link(path, there, follow_symlinks=False)
    commands.take()


def _of_package(package: str, name: str) -> Callable[[Path], bytes]:
    return lambda _: (files(package) / name).read_bytes()


# Of each kind: the file's name, what makes a valid one, what reads it.
RECORD_READERS: dict[str, tuple[str, Callable[[Path], bytes], Callable[[Path], object]]] = {
    "model of a decoder": ("model.json", lambda _: _model(), load_model),
    "samples of a practice": ("r.npy", _tracked, _read_tracked),
    "record of a Fitts test": ("f.toml", _fitts, lambda p: read_record(p, FittsRecord).score()),
    "hand of a person": ("person.toml", lambda _: b'hand = "left"\n', _read_hand),
    "key of the Player": (
        "key.txt",
        lambda _: b"0123456789abcdef\n",
        lambda p: versions_to_ask(PlayerOptions(version="3", app_id="tega", api_key_file=p)),
    ),
    "people's numbers": (
        "people.toml",
        _of_package("tega_sim.operator", "parameters.toml"),
        load_parameters,
    ),
    "simulated objects": ("things.toml", _of_package("tega_sim.world", "objects.toml"), read_objects),
    "moments of a light": (
        "flashes.csv",
        lambda _: b"t_ns,on\n" + b"".join(b"%d,%d\n" % (1000 * k, k % 2) for k in range(1, 9)),
        read_flashes,
    ),
    "delays of scene cameras": (
        "scene.offsets.json",
        lambda _: b'{"front": {"late_s": 0.05, "error_s": 0.002, "n_edges": 12}}',
        lambda p: read_offsets(p.with_name("scene.mcap")),
    ),
    "board of a session": (
        "now.json",
        lambda _: msgspec.json.encode(SessionBoard(t_ns=5, phase="rest", says="waits")),
        read_board,
    ),
    "commands to a session": ("told.jsonl", lambda _: 3 * b'{"do": "mark"}\n', _take_commands),
}
