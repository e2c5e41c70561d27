"""Read files as other programs write them, and compare each with its right answer: the tables of the page on files.

``TEGA_CASES=FOLDER python -m tega_figures.foreign_files`` prints the tables of ``docs/evidence/recording.md``. FOLDER holds
a folder per case, and the reference signal that each file of EMG was written from.
"""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from tega.errors import TegaError
from tega.runtime.files.formats import FORMATS
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading

_EXG = Reading(channels=(2, 3, 4))


class Case(NamedTuple):
    """A kind of file.

    Attributes:
        folder: Name of its folder.
        kind: What is special about it.
        before: Outcomes before there was one reader of tables.
        refused: Files that have to be refused, and a word that the error has to hold.
        faults: Files whose times are wrong, and a word that has to be said of it.
        reading: Choices with which the files are read.
        scales: Factors by which the numbers differ from the reference.
        step: Largest difference from it, by the step of a converter.
    """

    folder: str
    kind: str
    before: str
    refused: Mapping[str, str] = MappingProxyType({})
    faults: Mapping[str, str] = MappingProxyType({})
    reading: Reading = Reading()
    scales: tuple[float, ...] = (1.0,)
    step: float = 1e-3


CASES = (
    Case("01-decimal-comma", "decimal commas", "2 read as 2 and 6 channels, 3 refused for another cause"),
    Case("02-encodings", "UTF-16, Latin-1", "2 refused as binary"),
    Case("03-pandas-index", "index column of pandas", "2 with the index as a muscle"),
    Case("05-column-names", "first column is time, counter or label", "6 with it as a muscle"),
    Case(
        "06-openbci-gui", "OpenBCI GUI, one with 40 samples lost", "2 refused at the preamble",
        faults={"lost-40.txt": "40 samples were lost in 1 gap, the longest 160 ms"}, reading=_EXG,
    ),
    Case("07-brainflow", "BrainFlow, three locales", "1 read, 1 refused, 1 other columns", reading=_EXG),
    Case("08-preamble", "Delsys, Noraxon, LabVIEW, Excel", "4 refused at the preamble", scales=(1.0, 1e6)),
    Case("10-empty-cells", "missing cells, columns that end early", "2 read, 3 refused"),
    Case("11-sideways", "channels as rows, npz", "2 as 400 and 1500 channels, 2 refused"),
    Case(
        "12-containers", "formats of other programs",
        "5 read, 1 as 400 channels, 1 without a number, 7 refused, 8 refused for another cause",
        refused={
            "cell.mat": "several arrays", "complex.mat": "complex128", "three-d.mat": "shape (3, 500, 3)",
            "emg.h5": "damaged", "emg.parquet": "damaged", "emg.xlsx": "save the sheet as CSV",
            "labrecorder.xdf": "damaged",
            "empty.csv": "no sample", "header-only.csv": "no sample", "nanonly.csv": "no sample", "one-row.csv": "",
        },
        scales=(1.0, 0.1), step=0.11,
    ),
    Case(
        "20-time-column", "a time column: even, gap, back, twice, 6 % slow", "5 read without their times", reading=_EXG,
        faults={"backwards.csv": "steps back", "doubled.csv": "came twice", "gap-1s.csv": "250 samples were lost"},
    ),
)  # fmt: skip


def outcome(case: Case, path: Path, reference: np.ndarray) -> str:
    """Return ``read``, ``refused`` or what is wrong with how a file is read."""
    wanted = case.refused.get(path.name)
    try:
        found = read_signals(path, case.reading)
    except TegaError as error:
        return "refused" if wanted is not None and wanted in str(error) else f"wrongly refused: {error}"
    if wanted:
        return "should be refused"
    if wanted == "":
        return "read"
    if (fault := case.faults.get(path.name, "")) and not any(fault in one for one in found.decision.faults):
        return f"not said: {fault}"
    return "read" if _is_reference(found.samples, reference, case) else "other numbers"


def _is_reference(samples: np.ndarray, reference: np.ndarray, case: Case) -> bool:
    """Return whether each sample is one of the reference, in order; files are cut, samples may be lost or missing."""
    for scale in case.scales:
        scaled = samples * scale
        row = 0
        for sample in scaled:
            there = np.isfinite(sample)
            while row < len(reference):
                near = np.abs(reference[row, : len(sample)][there] - sample[there]) <= case.step
                row += 1
                if near.all():
                    break
            else:
                break
        else:
            return True
    return False


def rows(folder: Path) -> Iterator[str]:
    """Yield the lines of the table of cases."""
    reference = np.load(folder / "00-reference" / "plain.npy")
    yield "| case | files | before | now |"
    yield "|---|---|---|---|"
    total = right = 0
    for case in CASES:
        files = [one for one in sorted((folder / case.folder).iterdir()) if one.suffix not in {"", ".py"}]
        outcomes = [outcome(case, one, reference) for one in files]
        counts = {name: outcomes.count(name) for name in dict.fromkeys(sorted(outcomes))}
        said = ", ".join(f"{n} {name}" for name, n in counts.items())
        said += ", its times reported" if case.faults else ""
        total, right = total + len(files), right + counts.get("read", 0) + counts.get("refused", 0)
        yield f"| {case.kind} | {len(files)} | {case.before} | {said} |"
    yield f"| all | {total} | | {right} as they should be |"


def formats() -> Iterator[str]:
    """Yield the lines of the table of formats."""
    yield "| format | endings | written by | read by |"
    yield "|---|---|---|---|"
    for one in FORMATS:
        library = f"{one.library} {importlib.metadata.version(one.library)}" if one.library else "TEGA"
        yield f"| {one.name} | {' '.join(one.suffixes) or 'any other'} | {one.origin} | {library} |"


def main() -> None:
    """Print both tables."""
    for line in (*rows(Path(os.environ["TEGA_CASES"])), "", *formats()):
        print(line)


if __name__ == "__main__":
    main()
