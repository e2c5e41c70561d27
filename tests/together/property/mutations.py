"""Mutates files of every format that TEGA reads, and counts what comes of it.

``python tests/together/property/mutations.py --each 10000`` reads so many mutated files of each format, ``--only
recording`` one format. A recording stays a valid MCAP in most of them: its topics, schemas, types, tables,
attachments, messages and times are changed, and it goes through one verb of the command line after another. Of a
session's folder, a study's, and pictures with their marks and forces one file is changed, and the verbs get the
folder. Exit code 1 if anything else than an error of TEGA came of a file.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import shutil
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

sys.path.insert(0, str(Path(__file__).parents[2]))

from reference.foreign_readers import READERS as CORE_READERS
from reference.guest_readers import GUEST_READERS
from reference.mutated import FAR_NS, draw_changes, mutated
from reference.recordings import pressed
from tega.config import check_tree
from tega.errors import TegaError
from tega.loop import run_session
from tega.ui.cli.main import main as tega
from tega_study.detecting import detected_path
from tega_study.journal import events_path
from tega_study.observe import Observing
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.state import resume

READERS = CORE_READERS | GUEST_READERS
_KINDS = (
    "attachment",
    "table",
    "message",
    "topic",
    "schema",
    "type",
    "no table",
    "no attachment",
    "time",
    "bytes",
)


def odd(source: bytes, rng: random.Random) -> bytes:  # noqa: PLR0912  # one branch a kind
    """Return a recording with something changed; valid by its format but for the kind ``bytes``."""
    kinds = set(rng.sample(_KINDS, rng.randint(1, 2)))
    if "bytes" in kinds:
        return mutated(source, draw_changes(rng))
    attachments = list(NonSeekingReader(io.BytesIO(source)).iter_attachments())
    tables = list(NonSeekingReader(io.BytesIO(source)).iter_metadata())
    messages: list[Any] = list(NonSeekingReader(io.BytesIO(source)).iter_messages(log_time_order=False))
    schemas = {schema.name: schema for schema, _, _ in messages}
    topics = sorted({channel.topic for _, channel, _ in messages})
    victim, other = rng.choice(topics), rng.choice(topics)
    file = io.BytesIO()
    writer: Any = Writer(file)
    writer.start()
    gone = {"no attachment": rng.randrange(len(attachments) + 1), "no table": rng.randrange(len(tables) + 1)}
    for k, attachment in enumerate(attachments):
        if "no attachment" in kinds and k == gone["no attachment"]:
            continue
        content = attachment.data
        if "attachment" in kinds and rng.random() < 0.3:
            content = mutated(content, draw_changes(rng))
        writer.add_attachment(0, 0, attachment.name, attachment.media_type, content)
    for k, table in enumerate(tables):
        if "no table" in kinds and k == gone["no table"]:
            continue
        values = dict(table.metadata)
        if "table" in kinds and values and rng.random() < 0.5:
            _spoil(values, rng)
        writer.add_metadata(table.name, values)
    ids: dict[int, int] = {}
    for schema, channel, message in messages:
        if channel.id not in ids:
            own, topic, encoding = schema, channel.topic, schema.encoding
            if topic == victim and "topic" in kinds:
                topic = rng.choice(
                    [other, topic + "/x", "", "/", "/tactile//contact", topic.replace("thumb", "nose")]
                )
            if channel.topic == victim and "schema" in kinds:
                own = schemas[rng.choice(sorted(schemas))]
            data = own.data
            if channel.topic == victim and "type" in kinds:
                data = _retyped(own.name, own.data, rng)
                encoding = rng.choice([encoding, encoding, encoding, "json"])
            ids[channel.id] = writer.register_channel(
                topic, "protobuf", writer.register_schema(own.name, encoding, data)
            )
        content = message.data
        if "message" in kinds and channel.topic == victim and rng.random() < 0.2:
            content = mutated(content, draw_changes(rng))
        log_time = message.log_time
        if "time" in kinds and channel.topic == victim and rng.random() < 0.2:
            log_time = (log_time + rng.choice(FAR_NS)) % 2**64
        writer.add_message(ids[channel.id], log_time, content, message.publish_time)
    writer.finish()
    return file.getvalue()


def _spoil(values: dict[str, str], rng: random.Random) -> None:
    """Take a value of a table out, or change it."""
    key = rng.choice(sorted(values))
    if rng.random() < 0.3:
        del values[key]
    else:
        values[key] = mutated(values[key].encode(), draw_changes(rng)).decode("latin-1")


def _retyped(name: str, data: bytes, rng: random.Random) -> bytes:
    """Return a schema in which one field of a message has another type, name, or is gone."""
    from google.protobuf import descriptor_pb2 as pb2

    files: Any = pb2.FileDescriptorSet.FromString(data)
    found = [m for file in files.file for m in file.message_type if name.endswith(f".{m.name}")]
    if not found or not found[0].field:
        return data
    message = found[0]
    k = rng.randrange(len(message.field))
    field, how = message.field[k], rng.randrange(4)
    if how == 0:
        del message.field[k]
    elif how == 1:
        field.name = "something_else"
    elif how == 2:
        field.ClearField("type_name")
        field.type = rng.choice([field.TYPE_STRING, field.TYPE_DOUBLE, field.TYPE_BYTES, field.TYPE_INT32])
    else:
        field.label = field.LABEL_OPTIONAL if field.label == field.LABEL_REPEATED else field.LABEL_REPEATED
        field.ClearField("proto3_optional")
    described: bytes = files.SerializeToString()
    return described


def _recording(folder: Path) -> bytes:
    touch = {"driver": "synthetic-touch", "options": {"duration_s": 0.2}}
    tree = {
        "session": {"pace": "fast", "duration_s": 0.2},
        "tactile": {"thumb": touch},
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 0.2}},
        "recording": {"dir": str(folder / "made"), "stop_free_mib": 0.0},
    }
    summary = run_session(check_tree(tree, {}, base=folder).config)
    return (folder / "made" / str(summary["recording"]["file"])).read_bytes()


def _verbs(path: Path, out: Path) -> list[list[str]]:
    """Return every verb that reads a recording."""
    sink = ["--set", "vest.driver=vest-recorder", "--set", f"vest.options.file={out / 'v.csv'}"]
    return [
        ["recording", "inspect", str(path)],
        ["verify", str(path)],
        *(
            ["recording", "export", str(path), "--format", name, "--out", str(out / "export")]
            for name in ("csv", "parquet", "lerobot")
        ),
        ["recording", "trim", str(path), "--from", "0.05", "--out", str(out / "trimmed")],
        ["recording", "merge", str(path), str(path.parent / "whole.mcap"), "--out", str(out / "merged")],
        ["recording", "encode", str(path), "--out", str(out / "encoded")],
        ["play", str(path), "--speed", "20", *sink],
        ["audit", str(path)],
        ["audit", str(path), "--sweep", "stages.metric.name=live,paper"],
    ]


def _make_session(folder: Path) -> None:
    """Make two recordings, of which the second was never finished."""
    first = _recording(folder.parent / "one")
    shutil.copytree(folder.parent / "one" / "made", folder)
    (folder / "trial-002.mcap.part").write_bytes(first[: len(first) * 2 // 3])


def _verbs_of_session(folder: Path) -> list[list[str]]:
    words = [["relabel", "--task", "lift"], ["inspect"], ["encode", "--out", str(folder / "encoded")]]
    return [["recording", verb, str(folder), *more] for verb, *more in words]


def _make_study(folder: Path) -> None:
    write_plan(make_plan(participants=1, seed=5, objects=["bag"], trials=2, simulated=True), folder)
    journal, _ = resume(folder, read_plan(folder), "p01", t_ns=0, where="simulated")
    second_ns = 1_000_000_000
    with journal, Observing(folder, "p01", "r1", t_ns=0) as rater:
        for trial in (1, 2, 3, 4):
            begin_ns = 100 * trial * second_ns
            journal.add("trial_start", t_ns=begin_ns, trial=trial, source="auto")
            journal.add("lift_off", t_ns=begin_ns + 2 * second_ns, trial=trial, source="auto")
            rater.press("lift_off", begin_ns + 3 * second_ns)
            end_ns = begin_ns + 12 * second_ns
            journal.add("trial_end", t_ns=end_ns, trial=trial, status="done", success=True, source="auto")
            rater.check(end_ns)
            journal.add("rating", t_ns=end_ns, trial=trial, item="tlx.effort", value=10.0 * trial)
    shutil.copy(events_path(folder, "p01"), detected_path(folder, "p01"))


def _make_pictures(folder: Path) -> None:
    (folder / "presses").mkdir(parents=True)
    for name, force in (("still", 0.0), ("presses/0", 0.3), ("presses/1", 0.6)):
        (folder / f"{name}.png").write_bytes(cv2.imencode(".png", pressed(force, noise=1))[1].tobytes())
    (folder / "marks.csv").write_text("img_name,center_x,center_y,radius\n0.png,10,20,5\n1.png,11,21,6\n")
    (folder / "forces.csv").write_text("img_name,force_n\n0.png,1.5\n1.png,2.5\n")


def _verbs_of_study(folder: Path) -> list[list[str]]:
    score = ["study", "score", str(folder)]
    boris = [*score, "--boris", str(folder / "out.boris")]
    return [score, boris, [*score, "--json"], ["study", "report", str(folder)]]


def _verbs_of_pictures(folder: Path) -> list[list[str]]:
    audit = ["audit", str(folder / "presses"), "--baseline", str(folder / "still.png")]
    marks, forces = ["--marks", str(folder / "marks.csv")], ["--forces", str(folder / "forces.csv")]
    return [
        [*audit, *marks],
        [*audit, *forces],
        ["audit", str(folder / "presses"), "--json", *marks, *forces],
    ]


def _made_folder(make: Callable[[Path], None], folder: Path) -> bytes:
    make(folder / "made")
    return b""


# What is made as a folder of files, of which one is changed, and which verbs read it.
_FOLDERS: dict[str, tuple[Callable[[Path], None], Callable[[Path], list[list[str]]]]] = {
    "session's folder": (_make_session, _verbs_of_session),
    "study's folder": (_make_study, _verbs_of_study),
    "audited pictures": (_make_pictures, _verbs_of_pictures),
}


def _run(words: list[str]) -> str:
    """Carry out a verb; return what is wrong with how it ended."""
    text = io.StringIO()
    try:
        with contextlib.redirect_stderr(text), contextlib.redirect_stdout(io.StringIO()):
            tega(words)
    except SystemExit:
        pass
    except BaseException as error:  # a panic of native code as well
        return f"{type(error).__name__}: {error}"
    return next((line for line in text.getvalue().splitlines() if line.startswith("error: unexpected ")), "")


def _one(kind: str, content: bytes, rng: random.Random, folder: Path, k: int) -> tuple[str, str]:
    """Read one mutated file; return what read it, and what is wrong with that."""
    if kind in _FOLDERS:
        changed = folder / "changed"
        shutil.rmtree(changed, ignore_errors=True)
        shutil.copytree(folder / "made", changed)
        verbs = _FOLDERS[kind][1](changed)
        victim = rng.choice(sorted(path for path in changed.rglob("*") if path.is_file()))
        victim.write_bytes(mutated(victim.read_bytes(), draw_changes(rng)))
        chosen = verbs[k % len(verbs)]
        return f"{' '.join(w for w in chosen if str(folder) not in w)} ({victim.name})", _run(chosen)
    if kind == "recording":
        path = folder / "odd.mcap"
        path.write_bytes(odd(content, rng))
        (folder / "whole.mcap").write_bytes(content)
        with tempfile.TemporaryDirectory(dir=folder) as out:
            words = _verbs(path, Path(out))
            chosen = words[k % len(words)]
            return " ".join(
                w for w in (chosen[0], *chosen[3:4]) if not w.startswith((str(folder), "-"))
            ), _run(chosen)
    name, _, read = READERS[kind]
    path = folder / name
    is_mcap = kind == "recording of a scene"
    path.write_bytes(odd(content, rng) if is_mcap else mutated(content, draw_changes(rng)))
    try:
        read(path)
    except TegaError:
        return "", ""
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return "", f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
    return "", ""


def main() -> int:
    """Mutate what is asked for; return 0 if nothing but errors of TEGA came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=200, help="files a format")
    parser.add_argument("--only", default="", help="one format")
    parser.add_argument("--seed", type=int, default=1)
    requested = parser.parse_args()
    makers: dict[str, Callable[[Path], bytes]] = {kind: made for kind, (_, made, _) in READERS.items()}
    makers["recording"] = _recording
    makers |= {kind: partial(_made_folder, make) for kind, (make, _) in _FOLDERS.items()}
    wrong = 0
    for kind, make in makers.items():
        if requested.only not in {"", kind}:
            continue
        rng, found = random.Random(f"{requested.seed} {kind}"), Counter[str]()
        with tempfile.TemporaryDirectory() as name:
            content = make(Path(name))
            for k in range(requested.each):
                verb, text = _one(kind, content, rng, Path(name), k)
                found[f"{verb}: {text[:140]}"] += bool(text)
        n = found.total()
        wrong += n
        print(f"{kind}: {requested.each} files, {n} ended otherwise than by an error of TEGA", flush=True)  # noqa: T201
        for text, times in found.most_common(12):
            if times:
                print(f"    {times} {text}", flush=True)  # noqa: T201
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
