"""Files that were damaged, or made on purpose: every reader ends with TEGA's own errors, and at once."""

from __future__ import annotations

import contextlib
import io
import os
import random
import shutil
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from reference.filmed import packets, write_scene
from reference.foreign_readers import READERS, npy, toml
from reference.sessions import tree
from tega.config import load_config
from tega.config.calibration import load_calibration
from tega.errors import CalibrationError, ConfigError, RecordingError, TegaError
from tega.recording.inspection import inspect_file
from tega.recording.replay import replay_file
from tega.recording.replay.followed_file import PlayedMoment
from tega.recording.replay.play import play_file
from tega.records import EmgSamples
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.files.foreign_file import MIB, load_npy
from tega.stages.base import MeasuredPicture
from tega_scene.played import followed_scene

_FEW = settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


# What is passed over where it is damaged, so that nothing tells of a pipe there.
_NEEDLESS = {"summary of a run", "unfinished calibration", "board of a session", "commands to a session"}
_TOLD = [kind for kind in READERS if kind not in _NEEDLESS]
_SMALL = [kind for kind in _TOLD if kind != "recording of a scene"]

_SPOT = st.floats(0.0, 1.0, exclude_max=True)
_CHANGE = st.one_of(
    st.tuples(st.just("set"), _SPOT, st.binary(min_size=1, max_size=8)),
    st.tuples(st.just("insert"), _SPOT, st.binary(min_size=1, max_size=64)),
    st.tuples(st.just("cut"), _SPOT, st.just(b"")),
    st.tuples(st.just("twice"), _SPOT, st.just(b"")),
    st.tuples(st.just("zeros"), _SPOT, st.just(bytes(64))),
    st.tuples(st.just("instead"), _SPOT, st.binary(max_size=200)),
    st.tuples(st.just("deep"), _SPOT, st.sampled_from([b"[" * 5000, b'{"a":' * 5000, b"x = " + b"[" * 5000])),
)


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


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    made: dict[str, bytes] = {}

    def of(kind: str) -> bytes:
        if kind not in made:
            made[kind] = READERS[kind][1](tmp_path_factory.mktemp("valid"))
        return made[kind]

    return of


@pytest.mark.parametrize("kind", READERS)
@_FEW
@given(changes=st.lists(_CHANGE, max_size=4))
def test_whatever_a_file_holds_only_errors_of_tega_come_of_it(
    kind: str, valid: Callable[[str], bytes], changes: list[Any], tmp_path: Path
) -> None:
    name, _, read = READERS[kind]
    path = tmp_path / name
    path.write_bytes(mutated(valid(kind), changes))
    with contextlib.suppress(TegaError):
        read(path)


@pytest.mark.parametrize("kind", _TOLD)
def test_a_pipe_a_device_and_a_socket_are_refused_at_once(kind: str, tmp_path: Path) -> None:
    name, _, read = READERS[kind]
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


@pytest.mark.parametrize("kind", _SMALL)
def test_a_file_larger_than_any_of_its_kind_is_refused_unread(kind: str, tmp_path: Path) -> None:
    name, _, read = READERS[kind]
    path = tmp_path / name
    with path.open("wb") as file:
        file.truncate((256 * 1024 + 1) * MIB)  # takes no room on the disk
    with pytest.raises(TegaError, match=r"262145 MiB, at most \d+ MiB are read"):
        read(path)


@pytest.mark.parametrize(
    ("read", "error"),
    [(lambda p: load_config(p, environ={}), ConfigError), (load_calibration, CalibrationError)],
)
def test_settings_are_refused_by_their_own_error(
    read: Callable[[Path], object], error: type[TegaError], tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    path.write_bytes(b"# " + b"x" * 2 * MIB)
    with pytest.raises(error, match=r"lab\.toml: 2 MiB, at most 1 MiB"):
        read(path)


def test_the_mark_before_utf_8_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_bytes(b"\xef\xbb\xbf" + toml().replace(b"\n", b"\r\n"))
    assert load_config(path, environ={}).config.session.preset == "paper"
    path.write_bytes(toml().decode().encode("utf-16"))
    with pytest.raises(ConfigError, match="not UTF-8 text"):
        load_config(path, environ={})


def test_an_array_that_is_larger_than_its_file_asks_for_no_memory() -> None:
    data = npy(np.zeros((2, 3)))
    forged = data.replace(b"(2, 3)", b"(9999999999, 9999)", 1)
    forged = forged[:8] + (len(forged) - 48 - 10).to_bytes(2, "little") + forged[10:]
    with pytest.raises(RecordingError, match=r"not an \.npy array"):
        load_npy(forged, "emg.npy")
    objects = npy(np.zeros((2, 3)))
    with pytest.raises(RecordingError, match="Python objects"):
        load_npy(objects.replace(b"'<f8'", b"'|O' "), "emg.npy")


# A recording is valid by its format and still can hold anything: records are changed before they are written.

FAR_NS = [sign * size for size in (1_000_000, 10**12, 365 * 86_400 * 10**9, 2**62) for sign in (1, -1)]
"""By how much a message's log time is moved."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from tega.config import check_tree
    from tega.loop import run_session

    folder = tmp_path_factory.mktemp("session") / "small"
    wanted = tree(folder)
    wanted["session"]["duration_s"] = 0.2
    summary = run_session(check_tree(wanted, {}, base=Path.cwd()).config)
    return folder / str(summary["recording"]["file"])


def _odd(source: Path, target: Path, spot: float, changes: list[Any], kinds: set[str]) -> None:
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


def _looked_at(path: Path) -> None:
    """Play a recording as fast as it goes while somebody looks at its pictures and samples."""
    from tega.config import check_tree

    bus = Bus()
    for kind in (MeasuredPicture, EmgSamples, DisplayPicture):
        bus.subscribe(kind, lambda _one: None)
    out = path.parent / "played"
    shutil.rmtree(out, ignore_errors=True)
    play_file(
        path, check_tree({"session": {"out_dir": str(out)}}, {}, base=path.parent).config, speed=None, bus=bus
    )


def _scene_at(path: Path) -> None:
    """Look at a scene recording here and there."""
    bus = Bus()
    bus.subscribe(DisplayPicture, lambda _one: None)
    file = followed_scene(path, bus, start_ns=0, end_ns=3_000_000_000, behind_ns=2**62)
    for n, at_ns in enumerate((0, 1_400_000_000, 300_000_000, 2_900_000_000)):
        file.follow(PlayedMoment(n, at_ns, 0), threading.Event())


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    film = packets([k * 50_000_000 for k in range(40)])
    return write_scene(tmp_path_factory.mktemp("scene") / "scene.mcap", {"front": film, "side": film[:20]})


@_FEW
@given(changes=st.lists(_CHANGE, max_size=4), spot=_SPOT, whole=st.booleans())
def test_a_scene_recording_that_is_odd_is_told_to_be(
    scene: Path, changes: list[Any], spot: float, whole: bool, tmp_path: Path
) -> None:
    path = tmp_path / "odd.mcap"
    if whole:
        _odd(scene, path, spot, changes, {"message"})
    else:
        path.write_bytes(mutated(scene.read_bytes(), changes))
    with contextlib.suppress(TegaError):
        _scene_at(path)


@settings(parent=_FEW, max_examples=40)
@given(
    spot=_SPOT,
    changes=st.lists(_CHANGE, min_size=1, max_size=3),
    kinds=st.sets(st.sampled_from(["attachment", "table", "message", "name", "time"]), max_size=2),
)
def test_a_recording_that_is_odd_is_told_to_be(
    recording: Path, spot: float, changes: list[Any], kinds: set[str], tmp_path: Path
) -> None:
    path = tmp_path / "odd.mcap"
    if kinds:
        _odd(recording, path, spot, changes, kinds)
    else:
        path.write_bytes(mutated(recording.read_bytes(), changes))
    for use in (inspect_file, replay_file, _looked_at):
        with contextlib.suppress(TegaError):
            use(path)
