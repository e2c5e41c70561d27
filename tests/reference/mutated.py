"""Change files and recordings in a few places, and check that their readers refuse what is no file of theirs."""

from __future__ import annotations

import contextlib
import io
import os
import random
import socket
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from reference.foreign_readers import Reader
from tega.errors import TegaError
from tega.runtime.files.foreign_file import MIB

FEW = settings(
    max_examples=settings().max_examples // 2,  # of each kind; `make deep` reads 10,000
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
SPOT = st.floats(0.0, 1.0, exclude_max=True)
CHANGE = st.one_of(
    st.tuples(st.just("set"), SPOT, st.binary(min_size=1, max_size=8)),
    st.tuples(st.just("insert"), SPOT, st.binary(min_size=1, max_size=64)),
    st.tuples(st.just("cut"), SPOT, st.just(b"")),
    st.tuples(st.just("twice"), SPOT, st.just(b"")),
    st.tuples(st.just("zeros"), SPOT, st.just(bytes(64))),
    st.tuples(st.just("instead"), SPOT, st.binary(max_size=200)),
    st.tuples(st.just("deep"), SPOT, st.sampled_from([b"[" * 5000, b'{"a":' * 5000, b"x = " + b"[" * 5000])),
)

FAR_NS = [sign * size for size in (1_000_000, 10**12, 365 * 86_400 * 10**9, 2**62) for sign in (1, -1)]
"""By how much a message's log time is moved."""


def mutated(content: bytes, changes: list[tuple[str, float, bytes]]) -> bytes:
    """Return a file's content with some places of it changed."""
    for how, spot, new in changes:
        at = int(spot * len(content))
        match how:
            case "set" | "zeros":
                content = content[:at] + new + content[at + len(new) :]
            case "insert" | "deep":
                content = content[:at] + new + content[at:]
            case "cut":
                content = content[:at]
            case "twice":
                content = content[:at] + content
            case _:
                content = new
    return content


def odd(source: Path, target: Path, spot: float, changes: list[Any], kinds: set[str]) -> None:
    """Write a recording with one message, table, attachment, schema, topic or time of the source changed."""
    far_ns = random.Random(spot).choice(FAR_NS)
    data = source.read_bytes()
    attachments = list(NonSeekingReader(io.BytesIO(data)).iter_attachments())
    tables = list(NonSeekingReader(io.BytesIO(data)).iter_metadata())
    messages = list(NonSeekingReader(io.BytesIO(data)).iter_messages(log_time_order=False))
    with target.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        for k, attachment in enumerate(attachments):
            content = attachment.data
            if "attachment" in kinds and k == int(spot * len(attachments)):
                content = mutated(content, changes)
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, content)
        for k, table in enumerate(tables):
            values = dict(table.metadata)
            if "table" in kinds and k == int(spot * len(tables)):
                for key in list(values)[:: 1 + int(3 * spot)]:
                    values[key] = mutated(values[key].encode(), changes).decode("latin-1")
            writer.add_metadata(table.name, values)
        ids: dict[int, int] = {}
        for k, (schema, channel, message) in enumerate(messages):
            assert schema is not None
            if channel.id not in ids:
                named, topic = schema.name, channel.topic
                if "name" in kinds and len(ids) == int(spot * 8):
                    named, topic = messages[int(spot * len(messages))][0].name, topic + "/x"  # type: ignore[union-attr]
                schema_id = writer.register_schema(named, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(topic, "protobuf", schema_id)
            content, log_time = message.data, message.log_time
            if k == int(spot * len(messages)):
                content = mutated(content, changes) if "message" in kinds else content
                log_time += far_ns if "time" in kinds else 0
            writer.add_message(ids[channel.id], log_time % 2**64, content, message.publish_time)
        writer.finish()


def ends_with_errors_however_mutated(reader: Reader, folder: Path, n: int = FEW.max_examples) -> None:
    """Check that a reader ends with an error of TEGA, or none, for so many mutations of its file."""
    name, make, read = reader
    whole, path = make(folder), folder / "mutated" / name
    path.parent.mkdir()

    @settings(FEW, max_examples=n)
    @given(changes=st.lists(CHANGE, max_size=4))
    def check(changes: list[tuple[str, float, bytes]]) -> None:
        path.write_bytes(mutated(whole, changes))
        with contextlib.suppress(TegaError):
            read(path)

    check()


def refuses_what_is_no_file(reader: Reader, tmp_path: Path) -> None:
    """Check that a socket, a pipe and a device are refused at once."""
    name, _, read = reader
    pipe = tmp_path / name
    # First, since whoever opens a socket as a file is told so; a pipe or a device would be waited for.
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(pipe))
        with pytest.raises(TegaError, match=f"{name}: is a socket, not a file"):
            read(pipe)
    pipe.unlink()
    os.mkfifo(pipe)
    with pytest.raises(TegaError, match=f"{name}: is a pipe, not a file"):
        read(pipe)
    pipe.unlink()
    pipe.symlink_to("/dev/zero")
    with pytest.raises(TegaError, match=f"{name}: is a device, not a file"):
        read(pipe)


def refuses_a_huge_file(reader: Reader, tmp_path: Path) -> None:
    """Check that a file larger than any of its kind is refused unread."""
    name, _, read = reader
    path = tmp_path / name
    with path.open("wb") as file:
        file.truncate((256 * 1024 + 1) * MIB)  # takes no room on the disk
    with pytest.raises(TegaError, match=r"262145 MiB, at most \d+ MiB are read"):
        read(path)
