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
from typing import Any

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from msgspec.structs import replace

from reference.sessions import messages, read_recorded, reported, rewritten
from tega.config import StagesSection, check_tree
from tega.config.choose import muscle_decoder
from tega.devices.base import DeviceInfo
from tega.errors import RecordingError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.inbox.inputs import Finger, Muscles, Prepared
from tega.loop.inbox.sources import SourceReport, chunk_of, frame_of
from tega.recording.inspection import inspect_file
from tega.recording.mcap_reader import McapReader
from tega.recording.mcap_schemas import encoded, record_versions, schema_bytes
from tega.recording.replay import replay_file
from tega.recording.session import VERSION
from tega.records import RECORDS, Contact, EmgSamples, NamedValue, Picture
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
    """Return a recording of an earlier version."""
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


def test_a_recording_of_a_later_version_is_refused_by_the_name_of_its_record(
    golden: Path, tmp_path: Path
) -> None:
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


def _old_messages(path: Path) -> dict[str, list[Any]]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    old: dict[str, Any] = {}
    for schema in summary.schemas.values():
        if schema.name.startswith("tega."):
            for message in FileDescriptorSet.FromString(schema.data).file[0].message_type:
                old[message.name] = list(message.field)
    return old


def test_every_message_of_an_earlier_version_is_the_beginning_of_todays(golden: Path) -> None:
    (today,) = FileDescriptorSet.FromString(schema_bytes()).file
    fields = {message.name: list(message.field) for message in today.message_type}
    old, then = _old_messages(golden), reported(golden).get("records", {})
    assert len(old) > 15
    for name, before in old.items():
        assert [f.SerializeToString() for f in fields[name][: len(before)]] == [
            f.SerializeToString() for f in before
        ]
        assert len(fields[name]) == len(before) or record_versions()[name] > int(then.get(name, "1")), name


def test_records_read_from_an_earlier_version_are_written_as_the_same_bytes(golden: Path) -> None:
    kinds = {schema_name(kind): kind for kind in RECORDS if own_schema(kind)}
    seen = set()
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
            seen.add(kind)
    assert len(seen) >= {"1-paper": 10, "1-live": 18, "2-live": 12, "2-jpeg": 13}[golden.stem]


class _Given:
    """A source that gives what a recording holds."""

    ended = False

    def __init__(self, info: DeviceInfo, items: list[Any]) -> None:
        self.info, self._items = info, items

    def read(self, _timeout_s: float) -> Any:
        item = self._items.pop(0)
        self.ended = not self._items
        return item


def test_the_same_input_is_recorded_as_the_same_bytes_as_by_the_first_version(tmp_path: Path) -> None:
    golden = tmp_path / "paper.mcap"
    golden.write_bytes(lzma.decompress((GOLDEN / "1-paper.mcap.xz").read_bytes()))
    recorded = read_recorded(golden, Picture, EmgSamples)
    frames: dict[str, list[Any]] = {}
    for picture in recorded.of(Picture):
        frames.setdefault(picture.finger, []).append(frame_of(picture))
    chunks: list[Any] = [chunk_of(given) for given in recorded.of(EmgSamples)]
    head = recorded.head
    fingers: dict[str, Finger] = {}
    for name in head.baselines:
        given: Any = _Given(head.sources[name], frames[name])
        fingers[name] = Finger(given, head.baselines[name], "recording", SourceReport())
    emg = head.calibration.emg
    assert emg is not None
    decoder = muscle_decoder(StagesSection(), "paper", emg)
    amplifier: Any = _Given(head.sources["emg"], chunks)
    prepared = Prepared(fingers, Muscles(amplifier, emg, decoder, SourceReport()), head.calibration, "")
    looks = 0

    def haptics() -> bool:
        nonlocal looks
        looks += 1
        return not 12 < looks < 16

    tree = {
        "session": {"preset": "paper", "pace": "fast"},
        "recording": {"dir": str(tmp_path / "again"), "lossless": True, "stop_free_mib": 0.0},
    }
    summary = run_session(
        check_tree(tree, {}, base=tmp_path).config, prepared=prepared, controls=Controls(haptics=haptics)
    )
    again = tmp_path / "again" / summary["recording"]["file"]
    assert _by_topic(again) == _by_topic(golden)


def _by_topic(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Return time and bytes of all messages that do not tell of the machine's own time, by topic."""
    epoch_ns = int(reported(path)["tega"]["epoch_ns"])
    found: dict[str, list[tuple[int, bytes]]] = {}
    for topic, log_ns, _, data in messages(path):
        # Viewers' own messages hold a time of day.
        viewers = topic == "/hand/joints" or topic.endswith("/image")
        # A reason is words for people, which have been improved.
        today = data.replace(b"\x1a\x0call is there", b"\x1a\x11all devices ready")
        if topic not in {"/recorder/status", "/touch/event"}:  # the first version told no events
            found.setdefault(topic, []).append((log_ns - epoch_ns, b"" if viewers else today))
    return found
