"""Annotations, settings, baselines and videos of other programs, each given to the verb that a user would run."""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from tega_study.observers import read_observers

# Words of the error where a file has to be refused; every other file has to be read.
_BORIS = MappingProxyType({
    "beyond-end.tsv": "is outside", "negative.tsv": "is outside", "time-offset.boris": "is outside",
    "na-time.tsv": "is no time", "nan-time.tsv": "is no time",
})  # fmt: skip
_CONFIG = MappingProxyType({
    "backslash.toml": "single quotes", "decimal-comma.toml": "decimal point", "dup-table.toml": "twice",
    "latin1.toml": "UTF-8", "multiline-inline.toml": "inline table", "smart-quotes.toml": "straight quotes",
    "string-number.toml": "expected a number, got text", "utf16.toml": "UTF-16",
})  # fmt: skip
_BASELINE = MappingProxyType(
    {"baseline-rgb.png": "in RGB order", "baseline-180.png": "turned by 180 degrees"}
)

# Seconds between which each video shows a contact.
_CONTACT_S = MappingProxyType({"av1.mp4": (0.66, 1.31), "h264.mp4": (0.66, 1.31), "vfr.mp4": (4.02, 4.68)})
# One deformation from 2.0 s on and one slip at 3.0 s; a file may hold one of the two.
_EVENTS_S = MappingProxyType({"deformation": 2.0, "slip": 3.0})


def run_verb(*arguments: str | Path) -> tuple[int, str]:
    """Run a verb of ``tega-teleop``; return its exit code and what it prints, on one line."""
    command = [str(Path(sys.executable).with_name("tega-teleop")), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, " ".join((done.stdout + done.stderr).split())


def _judged(name: str, code: int, printed: str, refused: Mapping[str, str]) -> str:
    words = refused.get(name)
    if words is None:
        return "read" if code == 0 else f"wrongly refused: {printed}"
    return "refused" if code == 1 and words in printed else f"should be refused for {words!r}: {printed}"


def config_outcomes(folder: Path, _: Path) -> list[str]:
    """Return what ``config check`` makes of each settings file."""
    return [
        _judged(path.name, *run_verb("config", "check", path), _CONFIG)
        for path in sorted(folder.glob("*.toml"))
    ]


def baseline_outcomes(folder: Path, scratch: Path) -> list[str]:
    """Return what ``replay`` makes of each baseline."""
    frames = f"thumb={folder / 'frames'}"
    outcomes = []
    for path in sorted(folder.glob("*.png")):
        arguments = (
            "replay",
            "--preset",
            "paper",
            "--tactile",
            frames,
            "--baseline",
            f"thumb={path}",
            "--out",
        )
        outcomes.append(_judged(path.name, *run_verb(*arguments, scratch / path.stem), _BASELINE))
    return outcomes


def video_outcomes(folder: Path, scratch: Path) -> list[str]:
    """Return whether ``replay`` finds the contact of each video at its seconds."""
    return [_video_outcome(folder, name, scratch / Path(name).stem) for name in _CONTACT_S]


def _video_outcome(folder: Path, name: str, out: Path) -> str:
    video, baseline = f"thumb={folder / name}", f"thumb={folder / 'baseline.jpg'}"
    code, printed = run_verb(
        "replay", "--preset", "paper", "--tactile", video, "--baseline", baseline, "--out", out
    )
    if code:
        return f"wrongly refused: {printed}"
    rows = list(csv.DictReader((out / "contacts.csv").open(encoding="utf-8")))
    strongest = max(float(row["eda"]) for row in rows)
    at_s = [float(row["t_s"]) for row in rows if float(row["eda"]) > strongest / 2]
    first_s, last_s = _CONTACT_S[name]
    here = strongest > 0 and first_s <= at_s[0] and at_s[-1] <= last_s
    return "read" if here else f"contact at {at_s[0]} to {at_s[-1]} s"


def boris_outcomes(folder: Path, scratch: Path) -> list[str]:
    """Return what ``study score --import`` makes of each file of annotations, on a simulated study of one person."""
    study = scratch / "study"
    run_verb("study", "simulate", "--operators", "1", "--objects", "bottle", "--trials", "1", "--out", study)
    paths = (path for path in sorted(folder.iterdir()) if path.suffix in {".tsv", ".csv", ".boris", ".gz"})
    return [_boris_outcome(study, path, scratch / f"study {path.name}") for path in paths]


def _boris_outcome(study: Path, path: Path, copy: Path) -> str:
    shutil.copytree(study, copy)
    judged = _judged(path.name, *run_verb("study", "score", copy, "--import", path, "--rater", "r1"), _BORIS)
    if judged != "read":
        return judged
    events = read_observers(copy, "p01")["r1"]
    start_ns = next(event.t_ns for event in events if event.kind == "trial_start")
    found = [(event.kind, (event.t_ns - start_ns) / 1e9) for event in events if event.kind in _EVENTS_S]
    good = found and all(abs(at_s - _EVENTS_S[kind]) < 1e-3 for kind, at_s in found)
    return "read" if good and len(dict(found)) == len(found) else f"other events: {found}"
