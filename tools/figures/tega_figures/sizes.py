"""How large a recording is, stream by stream: ``python -m tega_figures.sizes`` prints the table of docs/recording.md.

Four emulated DIGITs at 60 Hz, EMG at 1 kHz, a hand and a vest, each a program of its own; one run with JPEG and one
lossless. A stream's size is that of its messages before compression, the file's is what the disk gets.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from tega.config import FINGERS, check_tree
from tega.loop.session import run_session
from tega.recording.inspection import Inspection, inspect_file
from tega.recording.mcap_folder import session_files
from tega_emulators.lab import PRESSED, emulated_lab, pressing

_EMG_HZ = 1000.0
_WORTH_A_ROW = 0.05


def _record(folder: Path, *, seconds: float, lossless: bool) -> Inspection:
    """Record a run, and look at what it left."""
    with emulated_lab(folder, emg_hz=_EMG_HZ, hand=True, vest=True, fingers=FINGERS, touch=PRESSED) as lab:
        lab.tree["session"] = {"duration_s": seconds}
        where = {"dir": str(folder / "recorded"), "queue_mib": 1000.0}  # whatever the disk is like
        lab.tree["recording"] = {**where, "lossless": lossless}
        config = check_tree(lab.tree, {}, base=folder).config
        with pressing(lab):
            lab.go_ahead()
            run_session(config)
    (file,) = session_files(folder / "recorded")
    return inspect_file(file)


def _per_minute(found: Inspection) -> dict[str, float]:
    """Return MiB a minute by stream, those of all fingers together, then of the file."""
    sizes: defaultdict[str, float] = defaultdict(float)
    for stream in found.streams:
        parts = stream.topic.split("/")
        topic = "/".join(["", "tactile", "FINGER", *parts[3:]]) if parts[1] == "tactile" else stream.topic
        sizes[topic] += stream.mib
    minutes = found.duration_s / 60
    ordered = sorted(sizes.items(), key=lambda item: -item[1])
    rows = {topic: mib / minutes for topic, mib in ordered if mib / minutes >= _WORTH_A_ROW}
    rows["everything else"] = sum(sizes.values()) / minutes - sum(rows.values())
    return rows | {"the file": found.mib / minutes}


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0)
    seconds = parser.parse_args().seconds
    columns = []
    for lossless in (False, True):
        with tempfile.TemporaryDirectory(prefix="tega-sizes-") as name:
            found = _record(Path(name), seconds=seconds, lossless=lossless)
        dropped = sum(stream.dropped for stream in found.streams)
        if dropped:
            sys.stderr.write(f"{dropped} records were dropped: the table would be wrong\n")
            return 1
        columns.append(_per_minute(found))
    lines = ["| MiB a minute | JPEG | lossless |", "|---|---|---|"]
    for topic in dict.fromkeys(name for column in columns for name in column):
        cells = (f"{column[topic]:.2f}" if topic in column else "–" for column in columns)
        lines.append(f"| {f'`{topic}`' if topic.startswith('/') else topic} | {' | '.join(cells)} |")
    print("\n".join(lines))  # this is a program
    return 0


if __name__ == "__main__":
    sys.exit(main())
