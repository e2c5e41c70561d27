"""A recording for other programs: tables, pictures, a dataset to learn from."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.command import call
from reference.sessions import SECONDS
from tega.config.choose import preset_metric
from tega.errors import ConfigError
from tega.recording import export, growing_table
from tega.recording.export import export_file
from tega.recording.growing_table import Columns, GrowingCsv, GrowingParquet
from tega.recording.mcap_reader import read_ahead
from tega.runtime.child_process import called_beside
from tega.runtime.files.csv_tables import cell_text


def test_tables_and_pictures_say_what_was_recorded(lossless, tmp_path, capsys):
    call(capsys, "recording", "export", lossless, "--out", tmp_path / "out", "--pictures")
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
    assert table.column_names == ["log_s", "t_s", "taken_s", "ch1", "ch2", "ch3", "fused"]


@pytest.mark.parametrize("kind", [GrowingCsv, GrowingParquet])
def test_columns_that_come_late_are_missing_before_in_rows_and_in_parts(kind, tmp_path, monkeypatch):
    pandas = pytest.importorskip("pandas", reason="reads both kinds")
    monkeypatch.setattr(growing_table, "_ROWS_PER_GROUP", 2)
    rows: list[Columns] = [
        {"k": [0, 1], "text": ['a "b",\nc', "d"], "x": [1, 2]},
        {"late": [0.5], "k": [2]},
        {"k": [3, 4], "late": [1.5, 2.5], "text": ["e", "f"], "x": [0.5, 1.5]},
    ]
    whole, table = kind(tmp_path / "whole"), kind(tmp_path / "table")
    table.add(rows[0])
    for columns in rows:
        whole.add(columns)
    for k, columns in enumerate(rows[1:]):
        part = kind(tmp_path / f"part{k}")
        part.add(columns)
        table.append(part.close())
    nothing = [None]
    wanted = {
        "k": [*range(5)],
        "text": ['a "b",\nc', "d", *nothing, "e", "f"],
        "x": [1, 2, *nothing, 0.5, 1.5],
    }
    read = pandas.read_csv if kind is GrowingCsv else pandas.read_parquet
    for made in (table, whole):
        found = read(made.close())
        assert found["late"].isna().tolist() == [True, True, False, False, False]
        assert found["late"].tolist()[2:] == [0.5, 1.5, 2.5]
        for name, cells in wanted.items():
            assert found[name].astype(object).where(found[name].notna(), None).tolist() == cells
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part0", "part1", "table", "whole"]


@given(
    cells=st.one_of(
        st.lists(st.floats()),
        st.lists(st.integers(-(2**63), 2**64 - 1)),
        st.lists(st.booleans()),
        st.lists(st.text(alphabet=',"\nab')),
        st.lists(st.one_of(st.floats(), st.integers(-9, 9), st.booleans(), st.none())),
    )
)
def test_a_column_s_text_is_that_of_its_cells(cells: list[Any]) -> None:
    assert list(growing_table._texts(cells)) == list(map(cell_text, cells))


def same_files(folder: Path, wanted: Path) -> None:
    """Check that two exports have the same files, Parquet by what it holds."""
    assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in wanted.iterdir())
    for one in folder.iterdir():
        if one.suffix == ".parquet":
            parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[parquet]")
            first, second = (parquet.read_table(path) for path in (one, wanted / one.name))
            assert (first.schema, str(first.to_pydict())) == (second.schema, str(second.to_pydict()))
        else:
            assert one.read_bytes() == (wanted / one.name).read_bytes()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_two_processes_write_the_same_tables_as_one(kind, lossless, tmp_path, monkeypatch):
    whole = export_file(lossless, tmp_path / "whole", kind=kind)
    called: list[tuple[Any, ...]] = []

    def noted(*asked: Any, lost: Exception) -> Any:
        called.append(asked)
        return called_beside(*asked, lost=lost)

    monkeypatch.setattr(export, "called_beside", noted)
    monkeypatch.setattr(export, "_SPLIT_BYTES", 0)
    halves = export_file(lossless, tmp_path / "halves", kind=kind)
    # Parts of the file are as large as what came in a tenth of a second.
    assert 0.1 < called[0][-1] / lossless.stat().st_size < 0.9
    assert [path.name for path in halves] == [path.name for path in whole]
    same_files(tmp_path / "halves", tmp_path / "whole")


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_an_export_keeps_few_messages_and_rows_of_any_recording(kind, lossless, tmp_path, monkeypatch):
    whole = export_file(lossless, tmp_path / "whole", kind=kind)
    n_kept, most = 8, 0

    def counted(table: Any, columns: Columns) -> None:
        nonlocal most
        if "chunk_t_s" not in columns:  # a chunk of EMG is many rows
            most = max(most, *(len(cells) for cells in columns.values()))
        write(table, columns)
        assert getattr(table, "_n_waiting", 0) < 16

    growing = GrowingCsv if kind == "csv" else GrowingParquet
    write = growing.add
    monkeypatch.setattr(growing, "add", counted)
    monkeypatch.setattr(export, "_MESSAGES_KEPT", n_kept)
    monkeypatch.setattr(growing_table, "_ROWS_PER_GROUP", 16)
    parts = export_file(lossless, tmp_path / "parts", kind=kind)
    assert most == n_kept
    assert [path.name for path in parts] == [path.name for path in whole]
    same_files(tmp_path / "parts", tmp_path / "whole")


def test_a_file_is_read_one_part_ahead() -> None:
    n_made = 0

    def parts() -> Iterator[int]:
        nonlocal n_made
        for k in range(20):
            n_made += 1
            yield k

    for k in read_ahead(parts()):
        assert n_made <= k + 2
    assert n_made == 20
