"""Recordings of every earlier version: they still open, say what made them, and compute to the same bits.

Each file in ``tests/golden`` begins with the version that its head states:

``1-paper``: two fingertips with the printed equations and EMG, lossless, on recorded time.
``1-live``: a fingertip, EMG, a vest, a hand and an arm, all emulated, in real time, JPEG pictures.
``2-live``: a fingertip whose force and area the vest shows, EMG, a reflex, a metric and a decoder beside; lossless.
``2-jpeg``: two such fingertips, JPEG pictures.
"""

from __future__ import annotations

import lzma
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.sessions import messages, reported, rewritten
from tega.errors import RecordingError
from tega.recording.inspection import inspect_file
from tega.recording.mcap_reader import McapReader
from tega.recording.mcap_schemas import encoded
from tega.recording.replay import replay_file
from tega.recording.session import VERSION
from tega.records import RECORDS, Contact, HandExchange, NamedValue
from tega.records.schema import own_schema, read, schema_name

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
    assert {one.compared for one in replay.pictures} == {"1-live": {17}, "2-live": {12}, "2-jpeg": {24}}.get(
        golden.stem, set()
    )


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
    with pytest.raises(
        RecordingError, match=r"its record Grip has version 1, this TEGA knows none; .*99\.0\.0"
    ):
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
