"""A recording opened in Python: the same numbers and pictures as other readers find, and nothing loaded too early."""

from __future__ import annotations

import csv
import io
import pickle
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

import tega
from reference.sessions import record
from tega.errors import MissingExtraError, RecordingError
from tega.recording import mcap_index, mcap_reader, topics
from tega.recording.export import export_file
from tega.recording.mcap_reader import Plan, RawMessage
from tega.recording.mcap_schemas import decoder
from tega.recording.opened import PictureTopic
from tega.recording.record_columns import channel_columns, find_kind

CONTACT = "/tactile/thumb/contact"


def by_the_public_reader(path: Path, topic: str) -> list[tuple[int, Any]]:
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(topics=[topic])
        return [
            (raw.log_time, decoder(schema.name, schema.data).FromString(raw.data))
            for schema, _, raw in found
            if schema is not None
        ]


def test_columns_hold_what_the_public_reader_finds(lossless: Path) -> None:
    recording = tega.open_recording(lossless)
    zero_ns = int(recording.start.timestamp()) * 1_000_000_000
    for topic, names in {
        CONTACT: ("eda", "cci", "front", "force_n"),
        "/emg/levels": ("fused",),
        "/run/state": (),
        "/hand/frames": ("level",),
    }.items():
        found = by_the_public_reader(lossless, topic)
        table = recording[topic].to_numpy()
        assert len(table) == len(found) == len(recording[topic])
        assert table["t_s"].tolist() == [value.t_ns / 1e9 for _, value in found]
        steps = np.diff([log_ns - zero_ns for log_ns, _ in found])
        assert np.diff(table["log_s"]) == pytest.approx(steps / 1e9, abs=1e-6)
        for name in names:
            assert table[name].tolist() == pytest.approx([getattr(value, name) for _, value in found])


def test_every_topic_has_columns_and_records(lossless: Path) -> None:
    recording = tega.open_recording(lossless.parent)
    for name, topic in recording.items():
        if isinstance(topic, PictureTopic):
            continue
        assert topic.kind is not None, name
        columns = topic.columns()
        lengths = {len(column) for column in columns.values()}
        assert len(lengths) == 1
        assert name == "/emg/samples" or lengths == {len(topic)}
        assert "log_s" in columns
        assert name == "/run/end" or "t_s" in columns
        assert isinstance(topic[0], topic.kind)
        assert isinstance(topic[-1], topic.kind)
        assert len(list(topic)) == len(topic) == len(topic.log_s)
    assert recording[CONTACT][30].finger == "thumb"
    assert recording.complete
    assert repr(recording).startswith("<recording trial-001.mcap: 1.5 s, ")
    with pytest.raises(KeyError, match="no such topic; there are"):
        recording["/nothing"]
    with pytest.raises(IndexError):
        recording[CONTACT][len(recording[CONTACT])]


def test_samples_have_a_row_each_at_the_source_s_rate(lossless, monkeypatch):
    found = by_the_public_reader(lossless, "/emg/samples")
    table = tega.open_recording(lossless)["/emg/samples"].to_numpy()
    names = [name for name in table.dtype.names or () if name not in {"t_s", "log_s", "index"}]
    samples = np.concatenate([np.reshape(value.samples, (-1, value.n_channels)) for _, value in found])
    assert np.array_equal(np.stack([table[name] for name in names], axis=-1), samples)
    assert np.array_equal(table["index"], np.arange(len(samples)))
    assert np.diff(table["t_s"]) == pytest.approx(1e-3)
    monkeypatch.setattr(topics, "_MOST_BLOCKS", 3)
    assert np.array_equal(tega.open_recording(lossless)["/emg/samples"].to_numpy(), table)
    units = dict.fromkeys(names, "uV") | {"t_s": "s", "log_s": "s"}
    assert tega.open_recording(lossless)["/emg/samples"].units == units


def test_pictures_are_decoded_one_by_one(lossless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    decoded: list[str] = []
    read = Plan.message

    def counted(plan: Plan, raw: RawMessage) -> Any:
        decoded.extend([plan.topic] if plan.decode else [])
        return read(plan, raw)

    monkeypatch.setattr(Plan, "message", counted)
    topic = "/tactile/thumb/image"
    pictures = pickle.loads(pickle.dumps(tega.open_recording(lossless)[topic]))
    assert (len(pictures), decoded) == (90, [])
    found = by_the_public_reader(lossless, topic)
    for number in (40, -1, 0):
        value = found[number][1]
        assert np.array_equal(
            pictures[number], np.frombuffer(value.data, np.uint8).reshape(value.height, value.width, 3)
        )
    assert decoded == [topic] * 3
    assert pictures.to_numpy().shape == (90, *pictures[0].shape)
    assert [picture.shape for picture in pictures[2:4]] == [pictures[0].shape] * 2
    with pytest.raises(RecordingError, match="/tactile/thumb/frame"):
        pictures.to_pandas()


@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.floats(-1, 3, allow_nan=False), max_size=4))
def test_slices_share_out_the_messages(lossless: Path, cuts: list[float]) -> None:
    recording = tega.open_recording(lossless)
    edges = [None, *sorted(cuts), None]
    parts = [recording[a:b] for a, b in pairwise(edges)]
    for topic in (CONTACT, "/tactile/ring/image"):
        joined = np.concatenate([part[topic].log_s for part in parts])
        assert np.array_equal(joined, recording[topic].log_s)
        for part, (begin, end) in zip(parts, pairwise(edges), strict=True):
            times = part[topic].log_s
            assert all(
                (begin is None or t >= begin - 1e-9) and (end is None or t < end + 1e-9) for t in times
            )
    empty = recording.between(1.0, 1.0)[CONTACT]
    assert (len(empty), empty.to_numpy()["force_n"].shape) == (0, (0,))
    for wrong in ((2.0, 1.0), (float("nan"), 1.0)):
        with pytest.raises(RecordingError, match="no span"):
            recording.between(*wrong)


def test_files_of_a_session_are_read_as_one(tmp_path: Path) -> None:
    paths = [record(tmp_path / "session", duration_s=0.4) for _ in range(2)]
    alone = [tega.open_recording(path) for path in paths]
    both = tega.open_recording(tmp_path / "session")
    assert both.files == tuple(paths)
    apart_s = (alone[1].start - alone[0].start).total_seconds()
    table = both[CONTACT].to_numpy()
    first, second = (one[CONTACT].to_numpy() for one in alone)
    assert table["file"].tolist() == [0] * len(first) + [1] * len(second)
    assert table["force_n"].tolist() == [*first["force_n"], *second["force_n"]]
    assert table["t_s"][len(first) :] == pytest.approx(second["t_s"] + apart_s, abs=1e-5)
    assert sum(both[apart_s - 1e-3 :][CONTACT].to_numpy()["file"]) == len(second)
    one, two = (recording["/tactile/thumb/image"] for recording in alone)
    assert np.array_equal(both["/tactile/thumb/image"][len(one)], two[0])
    assert "wall clock" in both.clock
    assert "file" in both["/emg/samples"].columns()


def test_an_unfinished_file_is_read_as_far_as_it_goes(lossless: Path, tmp_path: Path) -> None:
    whole = tega.open_recording(lossless)[CONTACT].to_numpy()
    data = lossless.read_bytes()
    lengths = []
    for share in (0.999, 0.7, 0.5, 0.3):
        cut = tmp_path / f"{share}.mcap"
        cut.write_bytes(data[: int(len(data) * share)])
        recording = tega.open_recording(cut)
        if CONTACT not in recording:
            lengths.append(0)
            continue
        table = recording[CONTACT].to_numpy()
        assert not recording.complete
        assert table["force_n"].tolist() == whole["force_n"][: len(table)].tolist()
        assert recording["/tactile/thumb/image"][0].ndim == 3
        lengths.append(len(table))
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == len(whole)


class _Counted(io.FileIO):
    n_read = 0

    def readinto(self, buffer: Any) -> int:
        n = super().readinto(buffer) or 0
        _Counted.n_read += n
        return n


def test_opening_and_one_picture_read_a_part_of_the_file(lossless, monkeypatch):
    """The head, the first parts, the index at the end, and the part that is asked for."""
    for module in (mcap_reader, mcap_index):
        monkeypatch.setattr(module, "open_recording", lambda path: io.BufferedReader(_Counted(path)))
    monkeypatch.setattr(_Counted, "n_read", 0)
    recording = tega.open_recording(lossless)
    assert _Counted.n_read < lossless.stat().st_size / 2
    assert len(recording["/tactile/thumb/image"]) == 90
    recording["/tactile/thumb/image"][45]
    assert _Counted.n_read < 0.8 * lossless.stat().st_size


def test_frames_and_tables_carry_topic_and_clock(lossless: Path) -> None:
    topic = tega.open_recording(lossless)[CONTACT]
    table = topic.to_numpy()
    frame, arrow = topic.to_pandas(), topic.to_arrow()
    assert frame.attrs["clock"] == topic.clock
    assert arrow.schema.metadata[b"topic"] == CONTACT.encode()
    for name in table.dtype.names or ():
        assert np.array_equal(frame[name].to_numpy(), table[name], equal_nan=table[name].dtype.kind == "f")
        column = np.array(arrow[name].to_pylist(), float)
        assert np.allclose(column, table[name].astype(float), equal_nan=True)
    assert "1970" not in topic.clock


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("pyarrow", "to_arrow")])
def test_a_missing_package_is_named(lossless, monkeypatch, package, method):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"{package}.*pip install"):
        getattr(tega.open_recording(lossless)[CONTACT], method)()


def test_an_unknown_topic_has_the_message_s_fields(lossless: Path) -> None:
    """A topic of a feature that is not installed."""
    assert find_kind("/elsewhere", "tega.Contact") is None
    topic = tega.open_recording(lossless)[CONTACT]
    topic.kind = None
    found = [value.eda for _, value in by_the_public_reader(lossless, CONTACT)]
    assert topic.columns()["eda"].tolist() == found


@pytest.mark.parametrize("content", [b"", b"no MCAP", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.mcap"):
        tega.open_recording(path)
    with pytest.raises(RecordingError):
        tega.open_recording(tmp_path / "missing.mcap")
    with pytest.raises(RecordingError):
        tega.open_recording()


def test_hostile_names_are_escaped(short: Path, tmp_path: Path) -> None:
    target = tmp_path / "<script>x.mcap"
    target.write_bytes(short.read_bytes())
    html = tega.open_recording(tmp_path)._repr_html_()  # which holds it alone, by that name
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert CONTACT in html


def test_an_export_and_the_topics_name_their_columns_alike(lossless: Path, tmp_path: Path) -> None:
    recording = tega.open_recording(lossless)
    assert recording["/emg/levels"].units["t_s"] == recording["/emg/levels"].units["log_s"] == "s"
    alone = {"/emg/samples": {"t_s"}}  # a time for each sample, where an export has the time of its chunk
    for table in export_file(lossless, tmp_path / "tables"):
        topic = f"/{table.stem.replace('.', '/')}"
        with table.open(encoding="utf-8", newline="") as file:
            exported = set(next(csv.reader(file)))
        ours = set(recording[topic].columns()) - alone.get(topic, set())
        assert exported - ours <= {"chunk_t_s", "dropped_topics"}, topic
        # A field that no message has is no column of an export.
        more = {name for name in ours - exported if np.any(~_missing(recording[topic].columns()[name]))}
        assert more <= {"t_s"}, topic


def _missing(column: Any) -> Any:
    return np.isnan(column) if column.dtype.kind == "f" else np.zeros(len(column), bool)


def test_a_channel_s_name_is_its_column_unless_it_is_repeated_or_taken() -> None:
    assert channel_columns(("flexor", "extensor"), 2) == ["flexor", "extensor"]
    assert channel_columns(("index", "flexor", "flexor"), 3, ("index",)) == ["ch1", "ch2", "ch3"]
    assert channel_columns(("flexor",), 2) == ["ch1", "ch2"]


def test_an_index_that_is_no_number_is_refused_with_the_way_to_what_was_meant(lossless: Path) -> None:
    topic = tega.open_recording(lossless)["/tactile/thumb/contact"]
    indices: tuple[Any, ...] = ("force_n", slice(1.0, 2.0), slice(None, 0.5), 3.0)
    for index in indices:
        with pytest.raises(RecordingError, match=r"messages are numbered.*recording\[10.0:20.0\]\[topic\]"):
            topic[index]
