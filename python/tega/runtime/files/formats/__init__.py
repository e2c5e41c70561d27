"""List the formats of EMG recordings: supported ones with their library, and alternatives for others."""

from __future__ import annotations

import importlib
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from tega.errors import RecordingError
from tega.runtime.files.tables.encoding import head_of
from tega.runtime.files.tables.table import Reading, Table

_HDF5 = b"\x89HDF\r\n\x1a\n"


class Format(NamedTuple):
    """A format that is read.

    Attributes:
        magic: Bytes with which its files begin; empty if they are known by their ending.
        reader: Module below this package, and its function that opens a file.
        library: Distribution that reads it; ``""`` if TEGA itself does.
        origin: Programs and devices that write it.
    """

    name: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    reader: str
    library: str
    origin: str

    def open(self, path: Path, reading: Reading) -> Table:
        """Open a file of this format; ``RecordingError`` where it is damaged or can be read in several ways.

        Where its library is missing, this and the readers raise ``MissingExtraError``.
        """
        module, _, function = self.reader.partition(":")
        opened: Callable[[Path, Reading], Table] = getattr(importlib.import_module(module), function)
        return opened(path, reading)


_HERE = "tega.runtime.files.formats"

FORMATS: Final[tuple[Format, ...]] = (
    Format("EDF", (".edf", ".rec"), (b"0       ",), f"{_HERE}.edf:open_edf", "edfio", "EDF, EDF+, EMG-BIDS"),
    Format("BDF", (".bdf",), (b"\xffBIOSEMI",), f"{_HERE}.edf:open_edf", "edfio", "BioSemi, BDF+"),
    Format("XDF", (".xdf", ".xdfz"), (b"XDF:",), f"{_HERE}.xdf:open_xdf", "pyxdf", "LabRecorder"),
    Format("MAT 7.3", (), (b"MATLAB 7.3",), f"{_HERE}.hdf5:open_mat73", "h5py", "MATLAB, save -v7.3"),
    Format("HDF5", (".h5", ".hdf5", ".hdf"), (_HDF5,), f"{_HERE}.hdf5:open_hdf5", "h5py", "HDF5, NWB"),
    Format("MAT", (".mat",), (b"MATLAB 5.0",), f"{_HERE}.hdf5:open_mat", "scipy", "MATLAB, Octave"),
    Format("NumPy array", (".npy",), (b"\x93NUMPY",), f"{_HERE}.named:open_npy", "", "numpy.save"),
    Format("NumPy archive", (".npz",), (), f"{_HERE}.named:open_npz", "", "numpy.savez"),
    Format("Parquet", (".parquet", ".pq"), (b"PAR1",), f"{_HERE}.named:open_parquet", "pyarrow", "pandas, Arrow"),
    Format("WAV", (".wav",), (b"RIFF",), f"{_HERE}.edf:open_wav", "", "SpikeRecorder"),
    Format(
        "text", (), (), "tega.runtime.files.tables.text:open_text", "",
        "CSV, TSV, .csv.gz; OpenBCI GUI, BrainFlow, Delsys, Noraxon, LabVIEW .lvm, LibEMG, pandas, R",
    ),
)  # fmt: skip
"""Formats that are read; the last one is tried for files of no other."""

_EXPORT_CSV = "export CSV"
OTHERS: Final[dict[str, tuple[str, str]]] = {
    **{end: (f"Excel {end}", "save the sheet as CSV") for end in (".xlsx", ".xlsm", ".xls")},
    ".ods": ("OpenDocument .ods", "save the sheet as CSV"),
    ".sav": ("SPSS .sav", _EXPORT_CSV),
    ".dta": ("Stata .dta", _EXPORT_CSV),
    ".sas7bdat": ("SAS .sas7bdat", _EXPORT_CSV),
    **{end.lower(): (f"R {end}", "write.csv(data, 'emg.csv') in R") for end in (".rds", ".RData")},
    **dict.fromkeys((".pkl", ".pickle"), ("a pickle", "numpy.save or to_csv; a pickle can run any program")),
    ".feather": ("Feather", "pandas.read_feather(f).to_parquet('emg.parquet')"),
    ".arrow": ("Arrow", "pandas.read_feather(f).to_parquet('emg.parquet')"),
    ".c3d": ("C3D", "export the analog channels as CSV"),
    **dict.fromkeys((".vhdr", ".vmrk", ".eeg"), ("BrainVision", "mne.export.export_raw to EDF")),
    **{end: (f"EEGLAB {end}", "export EDF from EEGLAB") for end in (".set", ".fdt")},
    ".fif": ("FIF", "mne.export.export_raw to EDF"),
    **{end: (f"Delsys {end}", "export CSV with Delsys File Utility") for end in (".hpf", ".shpf")},
    ".acq": ("Biopac .acq", "export CSV or EDF from AcqKnowledge"),
    ".poly5": ("TMSi .Poly5", "export EDF or XDF"),
    **{end: (f"OT Bioelettronica {end}", "export CSV or MAT") for end in (".otb+", ".otb4")},
    **{end: (f"Spike2 {end}", "export CSV or MAT") for end in (".smr", ".smrx")},
    ".abf": ("Axon .abf", _EXPORT_CSV),
    ".adicht": ("LabChart .adicht", "export text"),
    ".tdms": ("LabVIEW .tdms", "export CSV or .lvm"),
    **{end: (f"Intan {end}", "export CSV or MAT") for end in (".rhd", ".rhs")},
    ".json": ("JSON", _EXPORT_CSV),
    ".jsonl": ("JSON lines", _EXPORT_CSV),
    ".db3": ("a ROS 2 bag", "convert it to MCAP"),
    ".bag": ("a ROS 1 bag", _EXPORT_CSV),
    ".mcap": ("an MCAP recording", "verify re-runs a recording of TEGA; recording export writes CSV"),
    ".pdf": ("PDF", "ask for the numbers"),
    ".zip": ("a ZIP archive", "unpack it"),
    ".7z": ("a 7-Zip archive", "unpack it"),
    ".bz2": ("a bzip2 file", "unpack it"),
    ".xz": ("an xz file", "unpack it"),
    ".zst": ("a Zstandard file", "unpack it"),
}
"""Formats that are not read, by the ending of their files, with the way out."""

_OTHER_MAGIC = {
    b"\xd0\xcf\x11\xe0": ".xls", b"$FL2": ".sav", b"$FL3": ".sav", b"%PDF": ".pdf", b"\x89MCAP": ".mcap",
    b"#ROSBAG": ".bag", b"SQLite format 3": ".db3", b"7z\xbc\xaf": ".7z", b"BZh": ".bz2", b"\xfd7zXZ": ".xz",
    b"\x28\xb5\x2f\xfd": ".zst", b"TDSm": ".tdms", b"ARROW1": ".arrow", b"FEA1": ".feather",
}  # fmt: skip


def format_of(path: Path) -> Format:
    """Return a file's format, by its first bytes before its name; others are refused with a way out."""
    head, suffix = head_of(path, 32), path.suffix.lower()
    for known in FORMATS:
        other_edf = known.name == "EDF" and suffix not in known.suffixes
        if known.magic and head.startswith(known.magic) and not other_edf:
            return _checked(known, path, suffix)
    other = next((ending for magic, ending in _OTHER_MAGIC.items() if head.startswith(magic)), suffix)
    if head.startswith(b"PK\x03\x04"):
        other = _kind_of_zip(path, suffix)
        if other == ".npz":
            return next(known for known in FORMATS if other in known.suffixes)
    if other in OTHERS:
        name, route = OTHERS[other]
        raise RecordingError(f"{path.name}: {name} is not read as EMG", route)
    for known in FORMATS[:-1]:
        if suffix in known.suffixes:
            return known
    return FORMATS[-1]


def _checked(known: Format, path: Path, suffix: str) -> Format:
    """Refuse a binary format in a gzip file, which only text is read from."""
    with path.open("rb") as file:
        if file.read(2) == b"\x1f\x8b" and suffix != ".xdfz":
            raise RecordingError(
                f"{path.name}: a compressed {known.name} file is not read", "unpack it: gunzip"
            )
    return known


def _kind_of_zip(path: Path, suffix: str) -> str:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        names = []
    if suffix == ".npz" or any(name.endswith(".npy") for name in names):
        return ".npz"
    return suffix if suffix in OTHERS else ".xlsx" if "xl/workbook.xml" in names else ".zip"
