"""Tables of a LeRobot dataset as they are in its files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")

FPS = 25


def info(dataset: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((dataset / "meta" / "info.json").read_text())
    return content


def rows(dataset: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(dataset / "data/chunk-000/file-000.parquet").to_pylist()
    return found
