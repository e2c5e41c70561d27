"""A session as a LeRobot dataset, and its tables as they are in the files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tega.recording.trim import trim_session
from tega_lerobot.dataset import export_lerobot

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
av = pytest.importorskip("av", reason="needs the extra tega[lerobot]")

FPS = 25


@pytest.fixture(scope="module")
def parts(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    part = trim_session(lossless, from_s=0.4, to_s=1.1, out=tmp_path_factory.mktemp("part") / "part")
    return [lossless, part]


@pytest.fixture(scope="module")
def dataset(parts: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset") / "dataset"
    return export_lerobot(parts, folder, fps=FPS, task="lift the bottle")


def info(dataset: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((dataset / "meta" / "info.json").read_text())
    return content


def rows(dataset: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(dataset / "data/chunk-000/file-000.parquet").to_pylist()
    return found


def episodes(dataset: Path) -> list[dict[str, Any]]:
    path = dataset / "meta/episodes/chunk-000/file-000.parquet"
    found: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    return found
