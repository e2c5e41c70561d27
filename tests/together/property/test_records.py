"""Every field of every record survives from the bus to each file, table and link that holds it."""

from __future__ import annotations

import csv
import io
import math
import tempfile
from io import BufferedReader, BufferedWriter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import asdict, replace

from reference.record_strategies import records_of
from reference.sessions import read_recorded
from tega.config import FINGERS, check_tree
from tega.config.calibration import Calibration
from tega.devices.base import DeviceInfo
from tega.recording.export import export_file
from tega.recording.session import Recording
from tega.records import Contact, Intent, Picture, Record
from tega.records.bus import Bus
from tega.records.schema import fields, own_schema, values
from tega.records.table import columns, rows
from tega.records.types import record_types
from tega.runtime.child_process import receive_object, send_object
from tega_lerobot.episode import read_episode
from tega_link.clock import Offset
from tega_link.commands import Commands
from tega_link.messages import Feature, HandMessage, Welcome, decode, encode
from tega_link.touch import FarTouch

pytest.importorskip("foxglove", reason="needs the extra tega[record]")

START_NS = 5_000_000_000
_each = st.tuples(*map(records_of, record_types()))
_one = st.sampled_from(record_types()).flatmap(records_of)


def same(one: Any, other: Any) -> bool:
    """Whether two records are equal in every field, and every NaN is like another."""
    return type(one) is type(other) and repr(_plain(one)) == repr(_plain(other))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, value.tolist()
    return (
        {name: _plain(field) for name, field in asdict(value).items()} if isinstance(value, Record) else value
    )


def recorded(folder: Path, published: tuple[Record, ...]) -> Path:
    tree = {
        "session": {"pace": "fast"},
        "recording": {"dir": str(folder), "lossless": True, "stop_free_mib": 0.0},
    }
    config, bus = check_tree(tree, {}, base=folder).config, Bus()
    recording = Recording(config, folder, bus)
    infos = {name: DeviceInfo(driver="x", kind="tactile", label=name, live=False) for name in FINGERS}
    recording.describe(
        config,
        calibration=Calibration(preset="live", origin="made up"),
        calibration_name="made up",
        baselines=dict.fromkeys(FINGERS, np.zeros((4, 4, 3), np.uint8)),
        sources=infos | {"emg": DeviceInfo(driver="x", kind="emg", label="emg", live=False)},
        facts={
            "layout": "x40",
            "pace": "steady",
            "live_vest": "true",
            "steered": "true",
            "observed": "false",
        },
    )
    recording.start(START_NS, START_NS)
    for record in published:
        bus.publish(record)
    assert bus.problem() == ""
    facts = recording.close({})
    assert (facts["state"], facts["dropped"]) == ("complete", {})
    return folder / str(facts["file"])


@settings(max_examples=5)  # of each record one
@given(published=_each)
def test_every_record_is_read_out_of_its_file_as_the_bus_delivered_it(published: tuple[Record, ...]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = recorded(Path(folder), published)
        found: Any = read_recorded(path, *record_types())
        for one in published:
            wanted, there = _for_viewers(one.current()), found.of(type(one))
            if isinstance(one, Picture):
                (picture,) = there
                wanted = replace(one, pixels_crc32=picture.pixels_crc32, cells=picture.cells)
            assert any(same(wanted, _for_viewers(other)) for other in there), one


def _for_viewers(record: Record) -> Record:
    """Return a record without the sign of 0 where a viewer's message has it: some of these do not keep it."""
    if own_schema(type(record)):
        return record
    named = {name: getattr(record, name, ()) for name in ("position", "quaternion", "angles_rad")}
    return replace(record, **{name: tuple(v + 0.0 for v in value) for name, value in named.items() if value})


@given(record=_one)
def test_a_record_reaches_another_process_as_it_is(record: Record) -> None:
    file = io.BytesIO()
    writer: Any = BufferedWriter(file)  # bytes in memory stand for the pipe
    send_object(writer, record)
    reader: Any = BufferedReader(io.BytesIO(file.getvalue()))  # likewise
    assert same(record, receive_object(reader))


@given(contact=records_of(Contact), intent=records_of(Intent))
def test_contact_and_intent_come_over_the_link_with_every_field(contact: Contact, intent: Intent) -> None:
    sent = decode(Feature, encode(Feature(session=1, sequence=0, sent_ns=10, t_ns=5, contact=contact)))
    assert same(sent.contact, contact)
    touch = FarTouch("robot", ttl_ns=2**62)
    welcome = Welcome(station=1, fingers={contact.finger: 60.0}, hand=False, arm=False)
    touch.welcome(welcome)
    stream = touch.fingers(welcome)[contact.finger].stream
    assert stream is not None
    touch._start_ns = 0
    touch.feature(contact.finger, encode(sent), 10, Offset(0, 0))
    came = stream.next_until(10)
    if sent.malformed():
        assert came is None
    else:
        assert same(came, replace(contact, t_ns=5, taken_ns=0, known_ns=0))

    none = Offset(0, 0)
    commands = Commands(ttl_ns=2**62, offset=lambda _now: none, hand=True, tracker=None, clock=lambda: 10)
    commands.start(0, None)
    commands.begin(1)
    requested = HandMessage(session=1, sequence=0, sent_ns=10, intent=replace(intent, t_ns=5))
    obeyed = commands.hand(encode(requested))
    there = commands.blocks.next_until(10)
    if requested.malformed():
        assert (obeyed, there) == (None, None)
    else:
        assert obeyed is not None
        assert same(obeyed.intent, requested.intent)
        # The robot's station has one channel: the level itself.
        assert same(there, replace(intent, t_ns=5, taken_ns=0, channels=(intent.level,)))


def _read_cell(text: str, like: Any) -> Any:
    if text == "" and not isinstance(like, str):
        return None
    return text == "1" if isinstance(like, bool) else type(like)(text) if like is not None else text


@given(one=st.sampled_from([kind for kind in record_types() if kind.table]).flatmap(records_of))
def test_a_table_has_every_field_of_its_columns(one: Record) -> None:
    names = [name for name in one.table if name not in {"t_s", "frames", *one.columns}]
    values_of = {name: getattr(one, name) for name in names}
    many = {
        name: [f"{name}{k}" for k in range(len(value))]
        for name, value in values_of.items()
        if isinstance(value, tuple)
    }
    text = ",".join(columns(type(one), **many)) + "\n" + "".join(rows(one))
    for row in csv.DictReader(io.StringIO(text, newline="")):
        assert None not in row
        for name, value in values_of.items():
            if name in many:
                cells = [row[column] for column in many[name]]
                found: Any = tuple(_read_cell(cell, v) for cell, v in zip(cells, value, strict=True))
            else:
                found = _read_cell(row[_written(type(one), name)], value)
            assert repr(found) == repr(value), name


def _written(kind: type[Record], name: str) -> str:
    at = kind.__struct_fields__.index(name)
    return kind.__struct_encode_fields__[at]


@settings(max_examples=8)
@given(contact=records_of(Contact), intent=records_of(Intent))
def test_an_export_has_every_number_of_contact_and_intent(contact: Contact, intent: Intent) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = recorded(Path(folder) / "session", (contact, intent))
        export_file(path, Path(folder) / "tables")
        for one in (contact.current(), intent):
            name = one.where.strip("/").replace("/", ".")
            with (Path(folder) / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
                (row,) = csv.DictReader(file)
            for field, value in values(one).items():
                many = value if isinstance(value, list | tuple) else None
                if field == "more":
                    ours = {known.name for known in fields(Contact)}
                    own = {each["name"]: each["value"] for each in value}
                    ours |= {"log_s", *(f"{each[:-3]}_s" for each in ours if each.endswith("_ns"))}
                    found = {each: row[f"more.{each}" if each in ours else each] for each in own}
                    assert repr({each: float(text) for each, text in found.items()}) == repr(own)
                elif many is not None:
                    stem = "ch" if field == "channels" else f"{field}_"
                    cells = [row[f"{stem}{k}"] for k in range(1, len(many) + 1)]
                    numbers = [_read_cell(cell, v) for cell, v in zip(cells, many, strict=True)]
                    assert repr(numbers) == repr(list(many))
                elif field.endswith("_ns"):
                    assert float(row[f"{field[:-3]}_s"]) == value / 1e9, field
                else:
                    assert repr(_read_cell(row[field], value)) == repr(value), field


@settings(max_examples=8)
@given(contacts=st.lists(records_of(Contact), min_size=1, max_size=4), intent=records_of(Intent))
def test_a_data_set_has_contact_and_intent_as_they_were_recorded(contacts, intent):
    """Frames are 40 ms apart, and so are the records; what is no number of float32 is 0 there."""
    touched = [
        replace(one, finger="thumb", t_ns=k * 40_000_000, taken_ns=k * 40_000_000)
        for k, one in enumerate(contacts)
    ]
    requested = replace(intent, t_ns=0, taken_ns=0)
    with tempfile.TemporaryDirectory() as folder:
        episode = read_episode(recorded(Path(folder), (requested, *touched)), fps=25)
    assert episode.n_frames == len(touched)
    wanted = [replace(one).current() for one in touched]
    touch = [(one.eda, one.cci, one.in_contact) for one in wanted]
    assert np.array_equal(episode.columns["observation.touch"].values, _as_stored(touch))
    further = [(one.area_mm2, one.depth_mm, one.force_n) for one in wanted]
    if np.isfinite(_as_float32(further)).any():
        column = episode.columns["observation.touch_si"]
        assert column.names == ["thumb.area_mm2", "thumb.depth_mm", "thumb.force_n"]
        assert np.array_equal(column.values, _as_stored(further))
    else:
        assert "observation.touch_si" not in episode.columns
    levels = episode.columns["observation.emg_levels"].values
    assert np.array_equal(levels, _as_stored([(*requested.channels, requested.level)] * len(touched)))


def _as_stored(rows_of: list[tuple[Any, ...]]) -> np.ndarray:
    stored: np.ndarray = np.nan_to_num(_as_float32(rows_of), posinf=0.0, neginf=0.0)
    return stored


def _as_float32(rows_of: list[tuple[Any, ...]]) -> np.ndarray:
    numbers = np.array([[math.nan if v is None else v for v in row] for row in rows_of], np.float64)
    with np.errstate(over="ignore"):
        return numbers.astype(np.float32)
