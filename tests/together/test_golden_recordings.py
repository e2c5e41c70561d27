"""Recordings of every earlier version compute to the same bits, and fields keep the numbers that files have."""

from __future__ import annotations

import json
import lzma
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest
from msgspec.structs import replace

import tega
from reference.installed import OWN_FEATURE, own_feature, python
from reference.sessions import messages, reported, rewritten
from tega.errors import RecordingError
from tega.recording.inspection import inspect_file
from tega.recording.mcap_reader import McapReader
from tega.recording.mcap_schemas import encoded
from tega.recording.replay import replay_file
from tega.recording.session import VERSION
from tega.records import RECORDS, Contact, HandExchange, NamedValue, Record
from tega.records.schema import own_schema, read, schema_name
from tega_figures import record_fields
from tega_figures.record_fields import FILE, Table, fields_now, own_messages, problems

GOLDEN = Path(__file__).parents[1] / "golden"


STREAMS = {
    "1-paper": {
        "/emg/levels", "/hand/frames", "/tactile/ring/contact", "/tactile/ring/image", "/tactile/thumb/contact",
        "/tactile/thumb/image", "/vest/frame",
    },
    "1-live": {
        "/arm/turn", "/emg/levels", "/hand/bus", "/hand/frames", "/tactile/thumb/contact", "/vest/frame", "/vest/sent",
    },
    "2-live": {
        "/beside/paper/thumb", "/beside/proportional/emg", "/emg/levels", "/hand/frames", "/hand/reflex",
        "/tactile/thumb/contact", "/tactile/thumb/image", "/vest/frame",
    },
    "2-jpeg": {
        "/beside/proportional/emg", "/emg/levels", "/hand/frames", "/hand/reflex", "/tactile/ring/contact",
        "/tactile/thumb/contact", "/touch/event", "/vest/frame",
    },
}  # fmt: skip
"""Streams that a replay of each compares."""


@pytest.fixture(scope="module", params=list(STREAMS))
def golden(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("golden") / f"{request.param}.mcap"
    path.write_bytes(lzma.decompress((GOLDEN / f"{request.param}.mcap.xz").read_bytes()))
    return path


def test_there_is_a_recording_of_every_earlier_version() -> None:
    files = [path.name.removesuffix(".mcap.xz") for path in GOLDEN.glob("*.mcap.xz")]
    assert sorted(files) == sorted(STREAMS)
    assert {int(name.partition("-")[0]) for name in files} == set(range(1, int(VERSION)))


def test_a_recording_of_an_earlier_version_is_computed_again_bit_for_bit(golden: Path) -> None:
    replay = replay_file(golden)
    assert replay.complete
    rows = {s.stream: (s.recorded, s.differ) for s in replay.streams}
    assert all(recorded > 0 for recorded, _ in rows.values())
    assert {stream: differ for stream, (_, differ) in rows.items() if differ} == {}
    assert set(rows) == STREAMS[golden.stem]
    # In "1-live" the first contact comes before its picture.
    n_compared = {"1-live": {17}, "2-live": {12}, "2-jpeg": {24}}
    assert {one.compared for one in replay.pictures} == n_compared.get(golden.stem, set())


def test_a_recording_of_an_earlier_version_says_what_made_it(golden: Path) -> None:
    found, version = inspect_file(golden), golden.stem.partition("-")[0]
    assert (found.complete, found.cut) == (True, "")
    assert (found.versions["recording"], found.versions["tega"]) == (version, f"0.{version}.0")
    assert reported(golden)["tega"]["version"] == version
    counted = {stream.topic: stream.messages for stream in found.streams}
    assert sum(counted.values()) == len(messages(golden))


def test_a_recording_of_a_later_version_is_refused_by_the_name_of_its_record(golden, tmp_path):
    later = rewritten(golden, tmp_path / "newer.mcap", tables={"records": {"Contact": "99"}})
    text = f"newer.mcap: its record Contact has version 99, this TEGA knows {Contact.version}"
    with pytest.raises(RecordingError, match=text):
        replay_file(later)


def test_an_unknown_record_is_a_feature_s_unless_a_later_tega_made_it(golden: Path, tmp_path: Path) -> None:
    unknown = rewritten(golden, tmp_path / "unknown.mcap", tables={"records": {"Grip": "1"}})
    assert replay_file(unknown).same
    later = rewritten(unknown, tmp_path / "later.mcap", tables={"versions": {"tega": "99.0.0"}})
    why = r"its record Grip has version 1, this TEGA knows none; .*99\.0\.0"
    with pytest.raises(RecordingError, match=why):
        replay_file(later)


def test_records_read_from_an_earlier_version_are_written_as_the_same_bytes(golden: Path) -> None:
    kinds = {schema_name(kind): kind for kind in RECORDS if own_schema(kind)}
    seen, epoch_ns = set(), int(reported(golden)["tega"]["epoch_ns"])
    raw = {(topic, k): data for k, (topic, _, _, data) in enumerate(messages(golden))}
    for k, message in enumerate(McapReader(golden).messages()):
        if message.schema.startswith("tega."):
            kind = kinds[message.schema.removeprefix("tega.")]
            named = dict.fromkeys(kind.unwritten)
            record = read(kind, message.value, **named)
            further = (
                [value.name for value in message.value.more]
                if golden.stem[0] == "2" and kind is Contact
                else []
            )
            if further:
                # Version 2 named these values; now each has its field.
                assert further == ["area_mm2", "depth_mm", "force_n", "strength", "broad"]
                assert [getattr(record, name) for name in further] == [v.value for v in message.value.more]
                more = tuple(NamedValue(v.name, v.value, v.unit) for v in message.value.more)
                record = replace(record, more=more, **dict.fromkeys(further))
            assert encoded(record) == raw[message.topic, k]
            assert kind is HandExchange or record.log_ns == message.log_ns - epoch_ns
            seen.add(kind)
    assert len(seen) >= {"1-paper": 10, "1-live": 18, "2-live": 12, "2-jpeg": 13}[golden.stem]


TESTS = Path(__file__).parents[1]


@pytest.mark.skipif(not OWN_FEATURE.is_dir(), reason="not a checkout")
def test_records_of_an_installed_foreign_feature_are_left_out(tmp_path: Path) -> None:
    known = FILE.read_text(encoding="utf-8")
    file = tmp_path / "record-fields.json"
    file.write_text(known, encoding="utf-8")
    program = (
        "import pathlib; from tega.recording.mcap_schemas import record_messages; assert 'Grip' in record_messages()\n"
        f"from tega_figures import record_fields as r; r.FILE = pathlib.Path({str(file)!r}); r.update()\n"
        "assert r.own_messages().keys() == record_messages().keys() - {'Grip'}"
    )
    assert python("-c", program, folder=TESTS, site=own_feature(tmp_path))[0] == ""
    assert file.read_text(encoding="utf-8") == known


def test_a_tega_that_is_not_of_the_checkout_is_named_and_refused(tmp_path: Path) -> None:
    program, file = (tmp_path / Path(one).relative_to(TESTS.parent) for one in (record_fields.__file__, FILE))
    for to in (program, file):
        to.parent.mkdir(parents=True)
    shutil.copy(record_fields.__file__, program)
    file.write_text("{}")
    _, told = python(str(program), "--update", folder=tmp_path, site=tmp_path, code=1)
    assert f"tega is read from {Path(tega.__file__).resolve().parent}" in told
    assert "make setup" in told
    assert file.read_text() == "{}"


def test_a_record_has_the_field_numbers_that_its_files_have() -> None:
    table: Table = json.loads(FILE.read_text(encoding="utf-8"))
    messages = own_messages()
    assert problems(table, messages) == []
    for name, kind in messages.items():
        assert str(getattr(kind, "version", 1)) in table[name], "record_fields.py --update"


def made(version_: int, annotations: Mapping[str, type], **defaults: float) -> Any:
    members = {"__annotations__": {"version": ClassVar[int], "t_ns": int, **annotations}, "version": version_}
    struct: Any = type(Record)
    return struct("Made", (Record,), members | defaults, frozen=True, kw_only=True)


BEFORE = made(1, {"force_n": float}, force_n=0.0)
TWO = {"force_n": float, "more": float}
AT_THE_END = made(2, TWO, force_n=0.0, more=0.0)


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (made(2, {"more": float, "force_n": float}, force_n=0.0, more=0.0), "new ones go to the end"),
        (made(2, {"force_n": int}, force_n=0), "new ones go to the end"),
        (made(1, TWO, force_n=0.0, more=0.0), "raise the version"),
        (made(2, TWO, force_n=0.0), "more has no default"),
        (AT_THE_END, ""),
        (BEFORE, ""),
    ],
)
def test_a_field_in_the_middle_or_without_a_new_version_is_refused(kind: type[Record], sentence: str) -> None:
    found = problems({"Made": {"1": fields_now(BEFORE)}}, {"Made": kind})
    assert [sentence in one for one in found] == [True] * bool(sentence)


def test_a_version_before_that_of_files_is_refused() -> None:
    (found,) = problems({"Made": {"1": fields_now(BEFORE), "2": fields_now(AT_THE_END)}}, {"Made": BEFORE})
    assert "version 1 is before" in found
