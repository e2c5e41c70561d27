"""Recordings made into others: parts and merged sessions with the same bits, tables and pictures for programs."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.command import call
from reference.sessions import SECONDS, attached, messages, record, reported, rewritten, stream, tree
from tega.config import check_tree
from tega.config.choose import preset_metric
from tega.errors import ConfigError, RecordingError
from tega.loop import run_session
from tega.recording import export, growing_table
from tega.recording.export import export_file
from tega.recording.growing_table import Columns, GrowingCsv, GrowingParquet
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import read_ahead
from tega.recording.origin import LEAD_IN
from tega.recording.remake import merge_sessions
from tega.recording.replay import replay_file
from tega.recording.trim import trim_session
from tega.runtime.child_process import called_beside
from tega.runtime.files.csv_tables import cell_text
from tega_emulators.process import Emulator

S = 1_000_000_000


def epoch_ns(path: Path) -> int:
    return int(reported(path)["tega"]["epoch_ns"])


@pytest.fixture(scope="module")
def halves(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("halves")
    early = trim_session(lossless, from_s=0.0, to_s=0.8, out=folder / "early")
    return [early, trim_session(lossless, from_s=0.8, to_s=None, out=folder / "late")]


@pytest.mark.parametrize(("from_s", "to_s"), [(0.311, 0.937), (0.0, 0.7), (1.2, 99.0)])
def test_a_part_has_the_same_messages_and_computes_to_the_same_bits(lossless, tmp_path, from_s, to_s):
    part = trim_session(lossless, from_s=from_s, to_s=to_s, out=tmp_path / "part")
    start = epoch_ns(lossless) + round(from_s * S)
    end = epoch_ns(lossless) + round((to_s or 1e6) * S)
    wanted = [m for m in messages(lossless) if (from_s == 0 or m[1] >= start) and m[1] < end]
    there = messages(part)
    # Nothing is missing, nothing is changed; before it there are only pictures whose contact is in it.
    assert [m for m in there if m[1] >= start or from_s == 0] == wanted
    assert {m[0].rsplit("/", 1)[1] for m in there if m[1] < start and from_s > 0} <= {"image", "frame"}
    files = attached(part)
    assert (files.pop(LEAD_IN, None) is not None) == (from_s > 0)
    assert files == attached(lossless)
    tables = reported(part)
    assert tables.pop("span")["from_ns"] == str(round(from_s * S))
    assert tables.pop("origin-1")["file"] == lossless.name
    assert tables == reported(lossless)
    replay = replay_file(part)
    assert replay.same
    assert replay.from_s == from_s
    n_contacts = sum(m[0] == "/tactile/thumb/contact" for m in wanted)
    contact, image = stream(replay, "/tactile/thumb/contact"), stream(replay, "/tactile/thumb/image")
    assert (contact.recorded, contact.replayed) == (n_contacts, n_contacts)
    assert image.recorded >= n_contacts > 10


def test_without_what_came_before_a_replay_says_why_it_cannot(lossless, tmp_path, capsys):
    out = tmp_path / "part"
    words = ["recording", "trim", str(lossless), "--from", "0.5", "--no-lead-in", "--out", str(out)]
    assert json.loads(call(capsys, *words, "--json")[0]) == [str(out / "trial-001.mcap")]
    assert LEAD_IN not in attached(out / "trial-001.mcap")
    assert "trimmed from 0.5 s on without its lead-in" in call(capsys, "verify", out, code=1)[1]
    later = trim_session(out, from_s=0.8, to_s=None, out=tmp_path / "later")
    with pytest.raises(RecordingError, match="without its lead-in"):
        replay_file(later)


def test_a_part_of_a_part_tells_every_step(lossless: Path, tmp_path: Path) -> None:
    first = trim_session(lossless, from_s=0.3, to_s=1.2, out=tmp_path / "first")
    second = trim_session(tmp_path / "first", from_s=0.6, to_s=None, out=tmp_path / "second")
    assert replay_file(second).same
    found = inspect_file(second)
    steps = [(o["session"], int(o["from_ns"]), int(o["to_ns"])) for o in found.origin]
    assert steps == [
        (lossless.parent.name, 300_000_000, 1_200_000_000),
        ("first", 600_000_000, 1_200_000_000),
    ]
    assert found.from_s == 0.6
    assert found.duration_s == pytest.approx(0.6, abs=0.01)
    index = json.loads((tmp_path / "second" / "session.json").read_text())
    assert index["trials"][0]["origin"] == found.origin[-1]
    export_file(second, tmp_path / "tables")
    assert not (tmp_path / "tables" / LEAD_IN).exists()
    with pytest.raises(RecordingError, match=r"it goes from 0\.3 s to 1\.\d+ s"):
        trim_session(first, from_s=0.1, to_s=None, out=tmp_path / "third")


@pytest.mark.slow
def test_a_conversation_with_a_hand_is_held_from_its_beginning(tmp_path: Path) -> None:
    with Emulator("allegro_port") as hand:
        session = tree(tmp_path / "session") | {"session": {"pace": "real"}}
        patient = {"silent_after_ms": 10_000.0, "lowest_rate_hz": 0.0}
        session["hand"] = {"driver": "allegro", "options": {**hand.address, **patient}}
        run_session(check_tree(session, {}, base=tmp_path).config)
    part = trim_session(tmp_path / "session", from_s=0.6, to_s=1.3, out=tmp_path / "part")
    for file in (tmp_path / "session" / "trial-001.mcap", part):
        replay = replay_file(file)
        assert replay.same
        assert stream(replay, "/hand/bus").recorded > 0


def test_nothing_is_overwritten_and_a_wrong_span_is_told(lossless, halves, tmp_path):
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError, match="is there already"):
        trim_session(lossless, from_s=0.1, to_s=None, out=taken)
    with pytest.raises(ConfigError, match="is there already"):
        merge_sessions(halves, out=taken)
    for from_s, to_s, text in ((1.0, 0.5, "holds nothing"), (1e300, None, "is not in it")):
        with pytest.raises(RecordingError, match=text):
            trim_session(lossless, from_s=from_s, to_s=to_s, out=tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert [p.name for p in taken.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_sessions_are_merged_in_order_of_time_as_they_are(halves, tmp_path, capsys):
    early, late = halves
    call(capsys, "recording", "merge", late.parent, early, "--out", tmp_path / "both")
    both = sorted((tmp_path / "both").glob("*.mcap"))
    assert [messages(path) for path in both] == [messages(early), messages(late)]
    assert [attached(path) for path in both] == [attached(early), attached(late)]
    assert [reported(path)["origin-2"]["session"] for path in both] == ["early", "late"]
    assert all(replay_file(path).same for path in both)
    assert replay_file(both[1]).from_s == 0.8


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"tables": {"versions": {"numpy": "1.0"}}}, r"numpy \S+ and 1\.0"),
        ({"tables": {"tega": {"layout": "other"}}}, "vest .* and other"),
        ({"files": {"calibration.toml": b"other"}}, "another calibration"),
        ({"tables": {"tega": {"epoch_ns": "x"}}}, r"other\.mcap: damaged"),
    ],
)
def test_what_does_not_fit_together_is_not_merged(halves, tmp_path, change, text):
    early, late = halves
    other = rewritten(late, tmp_path / "other.mcap", **change)
    with pytest.raises(RecordingError, match=text):
        merge_sessions([early, other], out=tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_runs_that_did_not_wait_for_the_clock_are_merged_though_they_overlap(short, tmp_path):
    """As the lifts of a demo that is computed faster than it lasts."""
    later_ns = 50_000_000
    (tmp_path / "two").mkdir()
    two = rewritten(
        short,
        tmp_path / "two" / "trial-001.mcap",
        tables={"tega": {"epoch_ns": str(epoch_ns(short) + later_ns)}},
        times=lambda _topic, log_ns: log_ns + later_ns,
    )
    assert reported(short)["tega"]["start_ns"] == "0"
    both = merge_sessions([two.parent, short.parent], out=tmp_path / "both")
    assert [messages(path) for path in both] == [messages(short), messages(two)]
    with pytest.raises(RecordingError, match="of the same time"):
        merge_sessions([short.parent, short], out=tmp_path / "again")


@pytest.mark.parametrize("is_lossless", [True, False])
def test_a_merged_session_is_as_its_parts_and_a_damaged_one_is_refused(tmp_path, caplog, is_lossless):
    whole = record(tmp_path / "whole", duration_s=0.4, lossless=is_lossless)
    SessionFolder(whole.parent).label("lift")
    early = trim_session(whole, from_s=0.0, to_s=0.2, out=tmp_path / "early")
    late = trim_session(whole, from_s=0.2, to_s=None, out=tmp_path / "late")
    both = merge_sessions([early, late], out=tmp_path / "both")
    noted = json.loads((tmp_path / "both" / "session.json").read_text(encoding="utf-8"))
    assert [(trial["lossless"], trial["task"]) for trial in noted["trials"]] == [(is_lossless, "lift")] * 2
    assert [inspect_file(path).lossless for path in both] == [is_lossless] * 2
    data, at = late.read_bytes(), (open_indexed(late).middle() or 0) + 53  # where its compressed bytes begin
    late.write_bytes(data[:at] + bytes(9) + data[at + 9 :])
    with pytest.raises(
        RecordingError, match=r"late/trial-001\.mcap: (cannot be read to its end|has no index)"
    ):
        merge_sessions([early, late], out=tmp_path / "again")
    export_file(late, tmp_path / "tables")
    with suppress(RecordingError):  # nothing of a small one can be read
        trim_session(late, from_s=0.2, to_s=None, out=tmp_path / "trimmed")
    assert caplog.text.count("trial-001.mcap: cannot be read to its end: ") == 2


def test_recordings_of_the_same_time_are_not_merged(lossless, halves, tmp_path):
    late = halves[1]
    with pytest.raises(RecordingError, match=r"overlap by 0\.\d+ s of the same time"):
        merge_sessions([late, lossless], out=tmp_path / "both")
    with pytest.raises(RecordingError, match="only one recording"):
        merge_sessions([late], out=tmp_path / "both")
    folder = tmp_path / "two"
    folder.mkdir()
    for name in ("trial-001.mcap", "trial-002.mcap"):
        shutil.copy(late, folder / name)
    with pytest.raises(RecordingError, match="two: holds 2 recordings"):
        trim_session(folder, from_s=1.1, to_s=SECONDS, out=tmp_path / "new")


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
    n_kept, most = 9, 0  # of which there are some whole times in 90 contacts

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
