"""Files of other programs, mutated by a seed: every reader of media and logs ends with an error of TEGA, or reads."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import pytest

from reference.foreign_readers import READERS
from reference.mutated import draw_changes, mutated
from tega.errors import TegaError

_MEDIA = [
    "stack npy", "stack npz", "video AV1", "video H.264", "video VP9", "BORIS project", "BORIS project packed",
    "BORIS table", "BORIS aggregated", "ELAN", "annotations", "ROS 2 pictures", "ROS 2 arrays", "log .asc", "log .blf",
    "log .log", "log .trc",
]  # fmt: skip


@pytest.mark.parametrize("kind", _MEDIA)
@pytest.mark.parametrize("n", [60, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_mutated_file_ends_with_an_error_of_tega(kind: str, n: int, tmp_path: Path) -> None:
    name, make, read = READERS[kind]
    whole, rng = make(tmp_path), random.Random(f"{kind} 1")
    path = tmp_path / "mutated" / name
    path.parent.mkdir()
    for _ in range(n):
        path.write_bytes(mutated(whole, draw_changes(rng)))
        with contextlib.suppress(TegaError):
            read(path)
