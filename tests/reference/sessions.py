"""Recorded runs on made-up input, for the tests of recordings, and whole recordings as they are read."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from reference.played import finger, muscles
from tega import records
from tega.config import check_tree
from tega.loop import run_session
from tega.recording.mcap_schemas import decoder
from tega.recording.replay import Replay
from tega.recording.replay.feed import RecordFeed
from tega.records import Contact, EmgSamples, Picture, Record
from tega.records.bus import Bus
from tega.records.schema import own_schema
from tega.records.types import record_types
from tega.runtime.files.foreign_file import reports_damage

SECONDS = 1.5


def tree(folder: Path, **recording: Any) -> dict[str, Any]:
    return {
        "session": {"pace": "fast"},
        "tactile": {"thumb": finger(SECONDS), "ring": finger(1.0, seed=3)},
        "emg": muscles(SECONDS),
        "recording": {"dir": str(folder), "lossless": True, "stop_free_mib": 0.0, **recording},
    }


def synthetic(duration_s: float, *fingers: str, more: str = "") -> str:
    """Return settings that record made-up fingers and raw EMG into ``recorded``, and what is added to them."""
    touch = "".join(f'[tactile.{finger}]\ndriver = "synthetic-touch"\n' for finger in fingers)
    return f"""
[session]
preset = "live"
pace = "fast"
duration_s = {duration_s}
{touch}[emg]
driver = "synthetic-emg"
kind = "raw"
[recording]
dir = "recorded"
lossless = true
{more}"""


def record(
    folder: Path,
    *,
    duration_s: float | None = None,
    preset: str = "live",
    bus: Bus | None = None,
    **recording: Any,
) -> Path:
    wanted = tree(folder, **recording)
    wanted["session"] |= {"preset": preset} | ({} if duration_s is None else {"duration_s": duration_s})
    summary = run_session(check_tree(wanted, {}, base=Path.cwd()).config, bus=bus)
    assert summary["recording"]["state"] == "complete"
    assert summary["recording"]["dropped"] == {}
    return folder / str(summary["recording"]["file"])


def record_with_arm(folder: Path) -> Path:
    """Record a run with two markers, and the made-up records of an arm each time that a fingertip says something.

    The measured arm moves by 0.1 m/s along x, 10 mm below the target of its turns; viewers have a target from half a
    second on, 0.2 m higher.
    """
    bus = Bus()
    reported: list[int] = []

    def observe(contact: Contact) -> None:
        t_ns, turn = contact.taken_ns, (0.0, 0.0, 0.0, 1.0)
        x_m = 0.5 + 0.1 * t_ns / 1e9
        common: Any = {"t_ns": t_ns, "taken_ns": t_ns, "frame": "arm_base", "quaternion": turn}
        bus.publish(
            records.ArmTurn(
                t_ns=t_ns, poses=(), clutch=True, dead_man=True, may_move=True, stopped="", cleared=False,
                measured=(records.PoseNumbers(t_ns, (x_m, 0.0, 0.3), turn),), state="following", holds=1,
                reason="the arm follows the forearm", target=(x_m, 0.0, 0.31, *turn), velocity=(0.0,) * 6,
                phase="following",
            )
        )  # fmt: skip
        bus.publish(records.ArmMeasured(position=(x_m, 0.0, 0.3), **common))
        if t_ns >= 500_000_000:
            bus.publish(records.ArmTarget(position=(x_m, 0.0, 0.5), **common))
        if not reported:
            bus.publish(records.Marker(t_ns=200_000_000, text="lift", source="pedal"))
            bus.publish(records.HeardMarker(t_ns=800_000_000, text="put down", source="another program"))
        reported.append(t_ns)

    bus.subscribe(Contact, observe)
    return record(folder, bus=bus)


def rewritten(
    source: Path,
    target: Path,
    change: Callable[[str, Any], Any] = lambda _topic, value: value,
    *,
    files: Mapping[str, bytes] | None = None,
    tables: Mapping[str, Mapping[str, str]] | None = None,
    times: Callable[[str, int], int] = lambda _topic, log_ns: log_ns,
) -> Path:
    """Copy a recording with the public reader and writer, changing messages, attachments, tables and log times."""
    data, tables = source.read_bytes(), tables or {}
    with target.open("wb") as new:
        writer: Any = Writer(new)
        writer.start()
        for attachment in NonSeekingReader(io.BytesIO(data)).iter_attachments():
            content = (files or {}).get(attachment.name, attachment.data)
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, content)
        there = reported(source)
        for name in {**there, **tables}:
            writer.add_metadata(name, {**there.get(name, {}), **tables.get(name, {})})
        ids: dict[int, int] = {}
        for schema, channel, message in NonSeekingReader(io.BytesIO(data)).iter_messages(
            log_time_order=False
        ):
            assert schema is not None
            if channel.id not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(channel.topic, "protobuf", schema_id)
            value = decoder(schema.name, schema.data).FromString(message.data)
            changed = change(channel.topic, value).SerializeToString()
            log_ns = times(channel.topic, message.log_time)
            writer.add_message(ids[channel.id], log_ns, changed, message.publish_time)
        writer.finish()
    return target


def stream(replay: Replay, name: str) -> Any:
    return next(s for s in replay.streams if s.stream == name)


Raw = tuple[str, int, int, bytes]


def messages(path: Path) -> list[Raw]:
    """Return all messages as they are: topic, log time, publish time, bytes, in the order of the file."""
    with path.open("rb") as file:
        found = NonSeekingReader(file).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.publish_time, m.data) for _, c, m in found]


def attached(path: Path) -> dict[str, bytes]:
    with path.open("rb") as file:
        return {a.name: a.data for a in NonSeekingReader(file).iter_attachments()}


def reported(path: Path) -> dict[str, dict[str, str]]:
    tables: dict[str, dict[str, str]] = {}
    with path.open("rb") as file:
        for table in NonSeekingReader(file).iter_metadata():
            tables.setdefault(table.name, {}).update(table.metadata)
    return tables


Kind = TypeVar("Kind", bound=Record)


class Recorded:
    def __init__(self, feed: RecordFeed, kinds: tuple[type[Record], ...]) -> None:
        self.head = feed.head
        self._records: dict[type[Record], list[Any]] = {kind: feed.collect(kind) for kind in kinds}
        feed.read_rest()

    def of(self, kind: type[Kind]) -> list[Kind]:
        return self._records[kind]

    @property
    def contacts(self) -> dict[str, list[Contact]]:
        return {f: [one for one in self.of(Contact) if one.finger == f] for f in self.head.baselines}


@reports_damage
def read_recorded(path: Path, *kinds: type[Record]) -> Recorded:
    """Return the records of a recording: those of some types, or else joints and TEGA's own but the large ones."""
    large = {EmgSamples, Picture}
    every = (k for k in record_types() if k not in large and (own_schema(k) or k is records.Joints))
    return Recorded(RecordFeed(path), kinds or tuple(every))
