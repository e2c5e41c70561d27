"""A recording for other programs: tables, pictures, a dataset to learn from."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from reference.sessions import SECONDS
from tega.config.choose import preset_metric
from tega.errors import ConfigError
from tega.recording.export import export_file
from tega.recording.growing_table import GrowingCsv
from tega.ui.cli.main import main


def test_tables_and_pictures_say_what_was_recorded(lossless: Path, tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["recording", "export", str(lossless), "--out", str(tmp_path / "out"), "--pictures"])
    assert ended.value.code == 0
    with (tmp_path / "out" / "tactile.thumb.contact.csv").open(newline="") as file:
        contacts = list(csv.DictReader(file))
    baseline = np.load(tmp_path / "out" / "baseline-thumb.npy")
    assert len(contacts) == 90
    metric = preset_metric("live", baseline)
    for k, row in enumerate(contacts):
        image = cv2.imread(str(tmp_path / "out" / "thumb" / f"{k:06d}.png"))
        metrics = metric.update(np.asarray(image, np.uint8), round(float(row["t_s"]) * 1e9))
        assert (int(row["eda"]), float(row["cci"])) == (metrics.eda, metrics.cci)
    samples = (tmp_path / "out" / "emg.samples.csv").read_text().splitlines()
    assert samples[0] == "log_s,chunk_t_s,index,ch1,ch2,ch3"
    assert len(samples) == 1 + round(SECONDS * 1000)
    assert (tmp_path / "out" / "hand.frames.csv").read_text().count("180#") == round(SECONDS / 0.003) + 1
    with pytest.raises(ConfigError, match="is not empty"):
        export_file(lossless, tmp_path / "out")


def test_parquet_has_the_same_columns(lossless: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[parquet]")
    export_file(lossless, tmp_path / "out", kind="parquet")
    table = parquet.read_table(tmp_path / "out" / "emg.levels.parquet")
    assert table.num_rows == 15
    assert table.column_names == [
        "log_s",
        "t_s",
        "taken_s",
        "ch1",
        "ch2",
        "ch3",
        "fused",
    ]


def test_a_column_that_comes_late_is_empty_before(tmp_path: Path) -> None:
    table = GrowingCsv(tmp_path / "late.csv")
    table.add({"k": list(range(5000)), "said": ['a "b",\nc'] * 5000})
    table.add({"k": [5000, 5001, 5002], "late": [0.1] * 3, "said": [""] * 3})
    with table.close().open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["k"]) for row in rows] == list(range(5003))
    assert {row["said"] for row in rows[:5000]} == {'a "b",\nc'}
    assert [row["late"] for row in rows[4998:]] == ["", "", "0.1", "0.1", "0.1"]
    assert [path.name for path in tmp_path.iterdir()] == ["late.csv"]
