"""Make an hour's recording out of a short one, and measure what reading it as a library costs.

    python -m tega_figures.long_recording make SHORT.mcap hour.mcap --hours 1
    python -m tega_figures.long_recording measure SHORT.mcap hour.mcap

The long one repeats the messages of the short one, each time with later stamps; pictures stay the JPEG bytes they
are. Every measurement is a program of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from google.protobuf.message import Message

import tega
from tega.recording.mcap_copy import McapCopy, McapItem, McapRecords
from tega.recording.mcap_index import open_indexed

_S: Final = 1_000_000_000


def _shift(content: Message, by_ns: int) -> bytes:
    """Return a message of TEGA's or Foxglove's with later stamps."""
    for field, value in content.ListFields():
        if field.name.endswith("_ns") and isinstance(value, int):
            setattr(content, field.name, value + by_ns)
        elif field.name == "timestamp":
            total_ns = value.seconds * _S + value.nanos + by_ns
            value.seconds, value.nanos = divmod(total_ns, _S)
    shifted: bytes = content.SerializeToString()
    return shifted


def make(short: Path, long: Path, hours: float) -> None:
    """Write the long recording."""
    reader = open_indexed(short)
    # A whole number of seconds, so that streams of whole rates go on evenly.
    length_ns = -(-(reader.until_ns - reader.from_ns) // _S) * _S
    n = max(1, round(hours * 3600 * _S / length_ns))
    with long.open("wb") as file:
        copy = McapCopy(file)
        for turn in range(n):
            by_ns = turn * length_ns
            with short.open("rb") as source:
                for item in McapRecords(source):
                    if item.kind != "Message":
                        if turn == (n - 1 if getattr(item.record, "name", "") == "end" else 0):
                            copy.take(item)
                    elif turn == n - 1 or item.channel.topic != "/run/end":
                        copy.take(_later(item, by_ns))
            print(f"{turn + 1} of {n}", flush=True)
        copy.finish()


def _later(item: McapItem, by_ns: int) -> McapItem:
    record = item.record
    if by_ns:
        record.data = _shift(item.decoded(), by_ns)
        record.log_time, record.publish_time = record.log_time + by_ns, record.publish_time + by_ns
    return item


def _middle(recording: Any) -> Any:
    half_s = recording.duration_s / 2
    return recording[half_s : half_s + 10]


STEPS: Final[Mapping[str, Callable[[Any], Any]]] = MappingProxyType(
    {
        "open": lambda _recording: None,
        "contacts of a finger, to_numpy()": lambda r: r["/tactile/thumb/contact"].to_numpy(),
        "EMG samples, to_numpy()": lambda r: r["/emg/samples"].to_numpy(),
        "vest frames, to_pandas()": lambda r: r["/vest/frame"].to_pandas(),
        "times of all pictures, log_s": lambda r: r["/tactile/thumb/image"].log_s,
        "a picture in the middle": lambda r: r["/tactile/thumb/image"][len(r["/tactile/thumb/image"]) // 2],
        "10 s of pictures in the middle, to_numpy()": lambda r: _middle(r)["/tactile/thumb/image"].to_numpy(),
        "10 s of contacts in the middle, to_numpy()": lambda r: _middle(r)[
            "/tactile/thumb/contact"
        ].to_numpy(),
        "all pictures, one after the other": lambda r: sum(1 for _ in r["/tactile/thumb/image"]),
    }
)


def step(path: Path, name: str) -> dict[str, Any]:
    """Do one step; return its seconds, rows and peak memory beyond that of the program with its imports."""
    with_imports_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    recording = tega.open_recording(path)
    if name != "open":
        began_s, began_cpu_s = time.perf_counter(), time.process_time()
    result = STEPS[name](recording)
    wall_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
    mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    n = result if isinstance(result, int) else 0 if result is None else len(result)
    return {
        "wall_s": wall_s,
        "cpu_s": cpu_s,
        "mib": mib,
        "more_mib": mib - with_imports_kib / 1024,
        "result_mib": getattr(result, "nbytes", 0) / 2**20,
        "n": n,
    }


def measure(paths: list[Path]) -> None:
    """Print a table of all steps on all recordings."""
    for path in paths:
        recording = tega.open_recording(path)
        size_mb = path.stat().st_size / 1e6
        print(f"\n{path.name}: {recording.duration_s:.0f} s, {size_mb:.0f} MB, {len(recording)} topics\n")
        print(
            "| step | rows | s | processor s | peak memory, MiB | beyond the program's | the result's own |"
        )
        print("|---|---|---|---|---|---|---|", flush=True)
        for name in STEPS:
            words = [sys.executable, "-m", "tega_figures.long_recording", "step", str(path), name]
            found = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
            print(
                f"| {name} | {found['n'] or '–'} | {found['wall_s']:.2f} | {found['cpu_s']:.2f} "
                f"| {found['mib']:.0f} | {found['more_mib']:.0f} | {found['result_mib']:.1f} |",
                flush=True,
            )


def main() -> None:
    """Run the verb of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("make")
    making.add_argument("short", type=Path)
    making.add_argument("long", type=Path)
    making.add_argument("--hours", type=float, default=1.0)
    measuring = verbs.add_parser("measure")
    measuring.add_argument("paths", type=Path, nargs="+")
    stepping = verbs.add_parser("step")
    stepping.add_argument("path", type=Path)
    stepping.add_argument("name", choices=STEPS)
    args = parser.parse_args()
    if args.verb == "make":
        make(args.short, args.long, args.hours)
    elif args.verb == "measure":
        measure(args.paths)
    else:
        print(json.dumps(step(args.path, args.name)))


if __name__ == "__main__":
    main()
