"""EMG files that all hold one known signal: which are read, refused with their cause, or read wrongly."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from tega.errors import TegaError
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading

_EXG = Reading(channels=(2, 3, 4))


class EmgCase(NamedTuple):
    """A kind of EMG file.

    Attributes:
        folder: Name of its folder.
        kind: What is special about it.
        refused: Files that have to be refused, and words of the error. An empty text: either is right.
        faults: Files whose times are wrong, and words of the report.
        reading: Options with which the files are read.
        scales: Factors by which the numbers may differ from the reference (units).
        step: Largest difference from the reference: the step of a converter.
    """

    folder: str
    kind: str
    refused: Mapping[str, str] = MappingProxyType({})
    faults: Mapping[str, str] = MappingProxyType({})
    reading: Reading = Reading()
    scales: tuple[float, ...] = (1.0,)
    step: float = 1e-3


EMG_CASES = (
    EmgCase("01-decimal-comma", "decimal commas"),
    EmgCase("02-encodings", "UTF-16, Latin-1"),
    EmgCase("03-pandas-index", "index column of pandas"),
    EmgCase("05-column-names", "first column is time, counter or label"),
    EmgCase(
        "06-openbci-gui", "OpenBCI GUI, one with 40 samples lost",
        faults={"lost-40.txt": "40 samples were lost in 1 gap, the longest 160 ms"}, reading=_EXG,
    ),
    EmgCase("07-brainflow", "BrainFlow, three locales", reading=_EXG),
    EmgCase("08-preamble", "Delsys, Noraxon, LabVIEW, Excel", scales=(1.0, 1e6)),
    EmgCase("10-empty-cells", "missing cells, columns that end early"),
    EmgCase("11-sideways", "channels as rows, npz"),
    EmgCase(
        "12-containers", "formats of other programs",
        refused={
            "cell.mat": "several arrays", "complex.mat": "complex128", "three-d.mat": "shape (3, 500, 3)",
            "emg.h5": "damaged", "emg.parquet": "damaged", "emg.xlsx": "save the sheet as CSV",
            "labrecorder.xdf": "damaged",
            "empty.csv": "no sample", "header-only.csv": "no sample", "nanonly.csv": "no sample", "one-row.csv": "",
        },
        scales=(1.0, 0.1), step=0.11,
    ),
    EmgCase(
        "20-time-column", "a time column: even, gap, back, twice, 6 % slow", reading=_EXG,
        faults={"backwards.csv": "steps back", "doubled.csv": "came twice", "gap-1s.csv": "250 samples were lost"},
    ),
)  # fmt: skip


def emg_outcome(case: EmgCase, path: Path, reference: np.ndarray) -> str:
    """Return ``read``, ``refused``, or how a file is read wrongly."""
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
        return f"not reported: {fault}"
    scaled = (found.samples * scale for scale in case.scales)
    return "read" if any(_in_order(samples, reference, case.step) for samples in scaled) else "other numbers"


def _in_order(samples: np.ndarray, reference: np.ndarray, step: float) -> bool:
    """Return whether each sample is one of the reference, in order; some of the reference may be missing."""
    row = 0
    for sample in samples:
        there = np.isfinite(sample)
        while row < len(reference):
            near = np.abs(reference[row, : len(sample)][there] - sample[there]) <= step
            row += 1
            if near.all():
                break
        else:
            return False
    return True
