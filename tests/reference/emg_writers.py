"""Write samples into every format of EMG that TEGA reads, by a writer that is not TEGA's own."""

from __future__ import annotations

import csv
import gzip
import io
import wave
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import edfio
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import scipy.io
from numpy.typing import NDArray

from reference.xdf_file import Received, write_xdf

Samples = NDArray[np.float64]

RATE_HZ: Final = 250.0

_XDF_STREAM = """<?xml version="1.0"?><info><name>{name}</name><type>{type}</type><channel_count>{n}</channel_count>
<nominal_srate>{rate:g}</nominal_srate><channel_format>{format}</channel_format>
<desc><channels>{channels}</channels></desc></info>"""


class Writer(NamedTuple):
    """A writer of a format.

    Attributes:
        name: Name of a file of it.
        write: Writes samples, float64 (n, channels), into a file.
        step: Samples are kept to this step; 0 for exactly.
        channels: Columns that hold the samples, where more stand in the file; ``None`` for those that TEGA finds.
        rate: Whether the file states its rate.
    """

    name: str
    write: Callable[[Path, Samples], None]
    step: float = 0.0
    channels: Callable[[int], tuple[int, ...]] | None = None
    rate: bool = False


def _edf(signal: Any, file: Any) -> Callable[[Path, Samples], None]:
    def write(path: Path, samples: Samples) -> None:
        n = len(samples) - len(samples) % int(RATE_HZ)
        signals = [
            signal(
                column[:n],
                RATE_HZ,
                label=f"EMG {k}",
                physical_dimension="uV",
                physical_range=(-3276.8, 3276.7),
            )
            for k, column in enumerate(samples.T, start=1)
        ]
        file(signals, annotations=[edfio.EdfAnnotation(0.5, None, "squeeze")]).write(path)

    return write


def _text(**how: Any) -> Callable[[Path, Samples], None]:
    """Return a writer of text by Python's csv module, or by hand what it cannot write."""
    encoding, decimal = how.pop("encoding", "utf-8"), how.pop("decimal", ".")
    before, names, packed = how.pop("before", ""), how.pop("names", None), how.pop("gz", False)
    row: Callable[[int, Sequence[float]], list[Any]] = how.pop("row", lambda _k, cells: list(cells))

    def write(path: Path, samples: Samples) -> None:
        file = io.StringIO(newline="")
        file.write(before)
        writer = csv.writer(file, **({"lineterminator": "\n"} | how))
        if names is not None:
            writer.writerow(names(samples.shape[1]))
        for k, cells in enumerate(samples.tolist()):
            words = [repr(c) if isinstance(c, float) else c for c in row(k, cells)]
            writer.writerow([str(word).replace(".", decimal) for word in words])
        data = file.getvalue().encode(encoding)
        path.write_bytes(gzip.compress(data) if packed else data)

    return write


def _parquet(path: Path, samples: Samples) -> None:
    columns = {
        "time": np.arange(len(samples)) / RATE_HZ,
        **{f"ch{k}": c for k, c in enumerate(samples.T, start=1)},
    }
    pyarrow.parquet.write_table(pa.table(columns), path)


def _hdf5(path: Path, samples: Samples) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("rec/emg", data=samples, chunks=True, compression="gzip")
        file["rec"].attrs["sampling_rate"] = RATE_HZ
        file["rec/emg_mean"] = samples.mean(axis=0)


def _mat73(path: Path, samples: Samples) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["data/emg"] = samples.T
        file["data/fs"] = [[RATE_HZ]]
    mark = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        file.write(mark.ljust(124) + b"\x00\x02IM")


def _mat(path: Path, samples: Samples) -> None:
    scipy.io.savemat(path, {"data": {"emg": samples, "fs": RATE_HZ, "who": "p01"}}, do_compression=True)


def _npz(path: Path, samples: Samples) -> None:
    np.savez_compressed(path, emg=samples, fs=RATE_HZ, t=np.arange(len(samples)) / RATE_HZ)


def _wav(path: Path, samples: Samples) -> None:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(samples.shape[1])
        file.setsampwidth(2)
        file.setframerate(int(RATE_HZ))
        file.writeframes((samples * 10).round().astype("<i2").tobytes())


def xdf_header(name: str, kind: str, n: int, *, rate_hz: float = RATE_HZ, form: str = "double64") -> str:
    channels = "".join(
        f"<channel><label>ch{k}</label><unit>microvolts</unit></channel>" for k in range(1, n + 1)
    )
    return _XDF_STREAM.format(name=name, type=kind, n=n, rate=rate_hz, format=form, channels=channels)


def _xdf(path: Path, samples: Samples) -> None:
    times_s = (1000.0 + np.arange(len(samples)) / RATE_HZ).tolist()
    other = Received(xdf_header("eye", "Gaze", 2, rate_hz=60.0), [[0.0, 1.0]] * 5, times_s[:5])
    write_xdf(path, [other, Received(xdf_header("amp", "EMG", samples.shape[1]), samples.tolist(), times_s)])


def _numbered(n: int) -> list[str]:
    return [f"ch{k}" for k in range(1, n + 1)]


def _openbci(k: int, cells: Sequence[float]) -> list[Any]:
    return [float(k % 256), *cells, 0.1, 0.2, 1.0, 192.0, 1.7e9 + k / RATE_HZ, "2023-11-14 22:13:20.000"]


_OPENBCI = (
    "%OpenBCI Raw EXG Data\n%Number of channels = 8\n%Sample Rate = 250 Hz\n"
    "%Board = OpenBCI_GUI$BoardCytonSerial\n"
)
_LVM = (
    "LabVIEW Measurement\t\r\nWriter_Version\t2\r\nSeparator\tTab\r\nDecimal_Separator\t,\r\nX_Columns\tOne\r\n"
    "***End_of_Header***\t\r\n\t\r\nChannels\t2\t\r\nDelta_X\t0,004\t0,004\t\r\n***End_of_Header***\t\t\r\n"
)

WRITERS: Final[dict[str, Writer]] = {
    "CSV": Writer("a.csv", _text(names=_numbered)),
    "CSV, quoted": Writer("a.csv", _text(names=_numbered, quoting=csv.QUOTE_ALL)),
    "CSV of Excel in German": Writer(
        "a.csv", _text(names=_numbered, delimiter=";", decimal=",", lineterminator="\r\n")
    ),
    "text of Excel, UTF-16": Writer("a.txt", _text(names=_numbered, delimiter="\t", encoding="utf-16")),
    "CSV, Latin-1": Writer("a.csv", _text(names=lambda n: [f"{k} (µV)" for k in _numbered(n)], encoding="latin-1")),
    "CSV of pandas": Writer(
        "a.csv", _text(names=lambda n: ["", *map(str, range(n))], row=lambda k, cells: [k, *cells])
    ),
    "csv.gz": Writer("a.csv.gz", _text(names=_numbered, gz=True)),
    "OpenBCI GUI": Writer(
        "a.txt",
        _text(
            before=_OPENBCI, row=_openbci,
            names=lambda n: [
                "Sample Index", *(f" EXG Channel {k}" for k in range(n)), *(f" Accel Channel {k}" for k in range(3)),
                " Other", " Timestamp", " Timestamp (Formatted)",
            ],
        ),
        rate=True,
    ),
    "BrainFlow": Writer(
        "a.csv",
        _text(delimiter="\t", row=lambda k, cells: [float(k % 256), *cells, 0.0, 0.0, 1.7e9 + k / RATE_HZ, 0.0]),
        channels=lambda n: tuple(range(2, n + 2)),
        rate=True,
    ),
    "LabVIEW": Writer(
        "a.lvm",
        _text(
            before=_LVM, delimiter="\t", decimal=",", lineterminator="\r\n",
            names=lambda n: ["X_Value", *_numbered(n), "Comment"], row=lambda k, cells: [k / RATE_HZ, *cells],
        ),
        rate=True,
    ),
    "Delsys": Writer(
        "a.csv",
        _text(
            before="Label: S1: EMG 1 Sampling frequency: 250 Number of points: 9 start: 0 Unit: Volt\r\n\r\n",
            names=lambda n: [name for k in range(n) for name in ("X [s]", f"S{k}: EMG {k}")],
            row=lambda k, cells: [one for cell in cells for one in (k / RATE_HZ, cell)],
        ),
        rate=True,
    ),
    "Noraxon": Writer(
        "a.csv",
        _text(
            before="Name,Rec 1\r\nFrequency,250\r\n\r\n",
            names=lambda n: ["Time,s", *(f"EMG {k},uV" for k in range(n))],
            row=lambda k, cells: [k / RATE_HZ, *cells],
        ),
        rate=True,
    ),
    "EDF+": Writer("a.edf", _edf(edfio.EdfSignal, edfio.Edf), step=0.1, rate=True),
    "BDF+": Writer("a.bdf", _edf(edfio.BdfSignal, edfio.Bdf), step=0.0005, rate=True),
    "XDF": Writer("a.xdf", _xdf, rate=True),
    "npz": Writer("a.npz", _npz, rate=True),
    "Parquet": Writer("a.parquet", _parquet, rate=True),
    "HDF5": Writer("a.h5", _hdf5, rate=True),
    "MAT 7.3": Writer("a.mat", _mat73, rate=True),
    "MAT, a structure": Writer("a.mat", _mat, rate=True),
    "WAV": Writer("a.wav", _wav, step=1.0, rate=True),
}  # fmt: skip
"""Writers by format; XDF by the published layout, since no library writes it."""


def content_of(kind: str, folder: Path, samples: Samples) -> bytes:
    path = folder / WRITERS[kind].name
    WRITERS[kind].write(path, samples)
    return path.read_bytes()
