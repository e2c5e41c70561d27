"""Make a valid file of each kind that is kept of a person or a decoder, each beside what reads it."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import numpy as np

from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import PracticeRecord, write_record
from tega.devices.vest.player_versions import PlayerOptions, versions_to_ask
from tega_learn import fit
from tega_learn.model import load_model
from tega_practice.tracking import keep_tracked, read_tracked

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


def _read_hand(path: Path) -> None:
    home = CalibrationFolder(path.parent / "kept")
    home.person("p01").mkdir(parents=True, exist_ok=True)
    there = home.person("p01") / path.name
    there.unlink(missing_ok=True)
    os.link(path, there, follow_symlinks=False)  # pipes and sockets as well
    home.hand("p01")


# Of each kind: the file's name, what makes a valid one, what reads it.
RECORD_READERS: dict[str, tuple[str, Callable[[Path], bytes], Callable[[Path], object]]] = {
    "model of a decoder": ("model.json", lambda _: _model(), load_model),
    "samples of a practice": ("r.npy", _tracked, _read_tracked),
    "hand of a person": ("person.toml", lambda _: b'hand = "left"\n', _read_hand),
    "key of the Player": (
        "key.txt",
        lambda _: b"0123456789abcdef\n",
        lambda p: versions_to_ask(PlayerOptions(version="3", app_id="tega", api_key_file=p)),
    ),
}
