"""Hold every recording that a test writes against the public reader of MCAP, and every BORIS project against BORIS."""

from __future__ import annotations

import io
import json
import os
import struct
import subprocess
import sys
import zlib
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_MAGIC = b"\x89MCAP0\r\n"
# A footer record: opcode, length, start of the summary, start of its offsets, checksum; the magic follows.
_FOOTER = struct.Struct("<BQQQI")


def mcap_trouble(data: bytes) -> str:
    """Return what is wrong with a finished recording, ``""`` for nothing.

    Every record is read, with the checksum of every chunk; the summary's checksum, what it counts, and where it says
    that chunks and their lists of messages are, are those of the records.
    """
    from mcap.opcode import Opcode
    from mcap.reader import make_reader
    from mcap.records import Message, MessageIndex
    from mcap.stream_reader import StreamReader

    try:
        kinds: Counter[str] = Counter()
        topics: Counter[int] = Counter()
        indexed: Counter[int] = Counter()
        for record in StreamReader(io.BytesIO(data), validate_crcs=True).records:
            kinds[type(record).__name__] += 1
            if isinstance(record, Message):
                topics[record.channel_id] += 1
            elif isinstance(record, MessageIndex):
                indexed[record.channel_id] += len(record.records)
        summary = make_reader(io.BytesIO(data), validate_crcs=True).get_summary()
    except Exception as error:  # whatever the public reader does not take is a fault of ours
        return f"{type(error).__name__}: {error}"
    _, _, begins, _, stated = _FOOTER.unpack_from(data, len(data) - len(_MAGIC) - _FOOTER.size)
    checksum = zlib.crc32(data[begins : len(data) - len(_MAGIC) - 4])
    if not stated or stated != checksum:
        return f"the summary's checksum is {stated:#x}, its bytes have {checksum:#x}"
    counts = None if summary is None else summary.statistics
    if counts is None:
        return "no statistics"
    assert summary is not None
    lists = [at for one in summary.chunk_indexes for at in one.message_index_offsets.values()]
    message = {
        "messages": (counts.message_count, topics.total(), indexed.total()),
        "chunks": (
            counts.chunk_count,
            sum(data[one.chunk_start_offset] == Opcode.CHUNK for one in summary.chunk_indexes),
        ),
        "lists of messages": (kinds["MessageIndex"], sum(data[at] == Opcode.MESSAGE_INDEX for at in lists)),
        "attachments": (counts.attachment_count, kinds["Attachment"]),
        "tables": (counts.metadata_count, kinds["Metadata"]),
        "messages by channel": ({k: n for k, n in counts.channel_message_counts.items() if n}, dict(topics)),
    }
    return "; ".join(f"{subject} {n}" for subject, n in message.items() if any(one != n[0] for one in n))


def watch_recordings(patch: Any) -> list[str]:
    """Look at each recording when this process has finished it; what is wrong is added to the list returned.

    Args:
        patch: A ``pytest.MonkeyPatch``, which ends the watch when it is undone.
    """
    from tega.recording.mcap_copy import McapCopy
    from tega.recording.mcap_recorder import McapRecorder
    from tega.recording.recorder_process import RecorderProcess

    troubles: list[str] = []
    close, start, finish = McapRecorder._close_file, McapCopy.__init__, McapCopy.finish
    finish_live = RecorderProcess.finish
    files: dict[int, Any] = {}

    def check(path: Path) -> None:
        if message := mcap_trouble(path.read_bytes()):
            troubles.append(f"{path}: {message}")

    def closed(recorder: Any, *how: Any) -> None:
        close(recorder, *how)
        if recorder.state == "complete" and recorder.path.is_file():  # not a pipe
            check(recorder.path)

    def finished_live(recorder: Any, summary: bytes = b"") -> Any:
        facts = finish_live(recorder, summary)
        if recorder.state == "complete":
            check(recorder.path)
        return facts

    def started(copy: Any, file: Any) -> None:
        files[id(copy)] = file
        start(copy, file)

    def finished(copy: Any) -> None:
        finish(copy)
        file = files.pop(id(copy))
        file.flush()
        if isinstance(name := getattr(file, "name", None), str | Path):
            check(Path(name))

    patch.setattr(McapRecorder, "_close_file", closed)
    patch.setattr(RecorderProcess, "finish", finished_live)
    patch.setattr(McapCopy, "__init__", started)
    patch.setattr(McapCopy, "finish", finished)
    return troubles


# A program of its own: BORIS reads the command line of whoever imports it, and opens a display. Its package is not
# imported whole, which opens its window: its loader is, without the player's library, which it never calls.
_BORIS = """
import importlib.util, json, sys, types
path = sys.stdin.read()
boris = types.ModuleType("boris")
boris.__path__ = list(importlib.util.find_spec("boris").submodule_search_locations)
sys.modules["boris"] = boris
for player in ("mpv", "mpv2"):
    sys.modules[f"boris.{player}"] = types.SimpleNamespace(sofile="", dll="")
from boris import project_functions
name, changed, project, said = project_functions.open_project_json(path)
fault = project.get("error") or project_functions.check_project_integrity(project, "seconds", name, MEDIA)
told = {"name": name, "changed": changed, "project": project, "said": said, "fault": fault.replace("<br>", "")}
print("\\n" + json.dumps(told, default=float))
"""


def boris_project(path: Path, *, media: bool = False) -> dict[str, Any] | None:
    """Load a project file with BORIS' own loader; ``None`` where BORIS is not installed.

    ``TEGA_BORIS`` names a Python that has it, since it wants packages of other versions; else this one is asked.

    Args:
        path: The project.
        media: Whether its videos have to be there, too.

    Raises:
        AssertionError: BORIS changes it, warns of it, refuses it, or finds fault with an observation.
    """
    python = os.environ.get("TEGA_BORIS") or (sys.executable if find_spec("boris") else "")
    if not python:
        return None
    done = subprocess.run(
        [python, "-c", _BORIS.replace("MEDIA", str(media))],
        input=str(path),
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"QT_QPA_PLATFORM": "offscreen"},
        check=False,
        text=True,
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    reported: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    project: dict[str, Any] = reported.pop("project")
    assert reported == {"name": str(path), "changed": False, "said": "", "fault": ""}, reported
    return project
