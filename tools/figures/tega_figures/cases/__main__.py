"""Write the tables of files of other programs in ``docs/evidence/recording.md``.

``TEGA_CASES=FOLDER python -m tega_figures.cases docs/evidence/recording.md`` takes two minutes and 3 GB of disk. FOLDER
holds a folder for each case, and the reference signal that each EMG file was written from.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tega.runtime.files.formats import FORMATS
from tega_figures.cases.emg import EMG_CASES, emg_outcome
from tega_figures.cases.memory import memory_rows
from tega_figures.cases.others import baseline_outcomes, boris_outcomes, config_outcomes, video_outcomes

_OTHERS: tuple[tuple[str, str, Callable[[Path, Path], list[str]]], ...] = (
    ("17-boris", "annotations of BORIS", boris_outcomes),
    ("19-config", "settings files", config_outcomes),
    ("26-baseline-of-other-order", "baseline in RGB, or turned", baseline_outcomes),
    ("27-video", "AV1, H.264, variable frame rate", video_outcomes),
)


def _outcomes(folder: Path, scratch: Path) -> Iterator[tuple[str, list[str]]]:
    reference = np.load(folder / "00-reference" / "plain.npy")
    for case in EMG_CASES:
        files = [path for path in sorted((folder / case.folder).iterdir()) if path.suffix not in {"", ".py"}]
        yield case.kind, [emg_outcome(case, path, reference) for path in files]
    for name, kind, outcomes in _OTHERS:
        (scratch / name).mkdir()
        yield kind, outcomes(folder / name, scratch / name)


def case_rows(folder: Path, scratch: Path) -> Iterator[str]:
    """Yield the lines of the table of cases."""
    yield "| case | files | outcome |"
    yield "|---|---|---|"
    total: Counter[str] = Counter()
    for kind, outcomes in _outcomes(folder, scratch):
        counts = Counter(sorted(outcomes))
        total += counts
        yield f"| {kind} | {len(outcomes)} | {', '.join(f'{n} {name}' for name, n in counts.items())} |"
    right = total["read"] + total["refused"]
    yield f"| all | {total.total()} | **{right} of {total.total()} as they should be** |"


def format_rows() -> Iterator[str]:
    """Yield the lines of the table of formats."""
    yield "| format | endings | written by | read by |"
    yield "|---|---|---|---|"
    for one in FORMATS:
        library = f"{one.library} {importlib.metadata.version(one.library)}" if one.library else "TEGA"
        yield f"| {one.name} | {' '.join(one.suffixes) or 'any other'} | {one.origin} | {library} |"


def main() -> None:
    """Put the three tables into the page, each behind the comment with its name."""
    page = Path(sys.argv[1])
    text = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        tables = {
            "cases": case_rows(Path(os.environ["TEGA_CASES"]).resolve(), Path(scratch)),
            "formats": format_rows(),
            "memory": memory_rows(Path(scratch)),
        }
        for name, rows in tables.items():
            table = "\n".join(rows)
            before, after = re.split(rf"(?<=<!-- {name} -->\n\n)(?:\|.*\n)*", text)
            text = f"{before}{table}\n{after}"
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
