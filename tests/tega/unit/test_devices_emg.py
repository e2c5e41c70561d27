"""EMG files as people have them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from tega.devices.emg.emg_file import EmgFile, EmgFileOptions
from tega.errors import RecordingError
from tega.runtime.files.signals import Signals, read_signals
from tega.runtime.files.tables.table import Reading

ROWS = np.array([[1.0, -2.5, 3e-4], [4.0, 5.0, -6.0], [7.0, 8.25, 9.0]])


def read(path: Path, content: Any, **how: Any) -> Signals:
    """Write text, bytes, an array or the variables of a MAT file, and read them."""
    match content:
        case str():
            path.write_text(content, encoding="utf-8", newline="")
        case bytes():
            path.write_bytes(content)
        case dict():
            scipy.io.savemat(path, content)
        case _:
            np.save(path, content)
    return read_signals(path, Reading(**how))


@pytest.mark.parametrize(
    "text",
    [
        "1,-2.5,3e-4\n4,5,-6\n7,8.25,9\n",
        "1;-2.5;3e-4\r\n4;5;-6\r\n7;8.25;9",
        "1\t-2.5\t3e-4\n4\t5\t-6\n7\t8.25\t9\n",
        "1 -2.5  3e-4\n 4 5 -6\n7 8.25 9 \n",
        "# made by a logger\n# rate 200\n1,-2.5,3e-4\n4,5,-6\n\n7,8.25,9 # last\n",
        "\ufeffECR,FCU,FDS\n1,-2.5,3e-4\n4,5,-6\n7,8.25,9\n",
        "1,-2.5,3e-4,\n4,5,-6,\n7,8.25,9,\n",
        "a b c\n1 -2.5 3e-4\n4 5 -6\n7 8.25 9\n",
    ],
)
def test_text_is_read_whatever_its_habits(tmp_path: Path, text: str) -> None:
    found = read(tmp_path / "emg.txt", text)
    np.testing.assert_array_equal(found.samples, ROWS)
    assert found.channels == (1, 2, 3)


@pytest.mark.parametrize(
    ("name", "content", "how", "samples"),
    [
        ("e.csv", "1,2,3\n4,5,6\n", {"channels": (3, 1)}, [[3, 1], [6, 4]]),
        ("e.csv", "time,emg\n12:30:01,5\n12:30:02,nan\n", {"channels": (2,)}, [[5.0], [np.nan]]),
        ("e.npy", ROWS, {"channels": (2,)}, ROWS[:, [1]]),
        ("e.npy", np.arange(3, dtype=np.int16), {}, [[0], [1], [2]]),
        ("e.mat", {"emg": ROWS, "Force": np.arange(3.0)}, {"channels": (2,)}, ROWS[:, [1]]),
        ("e.mat", {"data": ROWS, "raw": ROWS}, {"variable": "data"}, ROWS),
    ],
)
def test_what_is_asked_for_is_given_in_its_order(name, content, how, samples, tmp_path):
    found = read(tmp_path / name, content, **how)
    np.testing.assert_array_equal(found.samples, samples)
    assert found.samples.dtype == np.float64
    assert found.channels == how.get("channels", tuple(range(1, 1 + len(samples[0]))))


@pytest.mark.parametrize(
    ("name", "content", "how", "message"),
    [
        ("e.csv", "1,2\n3,x\n", {}, r"e\.csv:2: not a row of numbers: '3,x'; fix or delete"),
        ("e.csv", "1,2\n3,4,5\n", {}, r"e\.csv:2: 3 cells, the lines before have 2: '3,4,5'"),
        ("e.csv", "1,2\n3\n", {}, r"e\.csv:2: 1 cells, the lines before have 2: '3'"),
        ("e.csv", "1,2\n1_0,3\n", {}, r"e\.csv:2: not a row of numbers: '1_0,3'"),
        ("e.csv", "1,x\n2,3\n", {}, r"e\.csv:1: not a row of numbers: '1,x'"),
        ("e.csv", "a,b\nc,d\n", {}, r"e\.csv:2: not a row of numbers: 'c,d'"),
        ("e.csv", "# nothing\n", {}, r"e\.csv: holds no sample"),
        ("e.csv", "a,b\n", {}, r"e\.csv: holds no sample"),
        ("e.csv", b"1,2\n\xff\xfe\n", {}, r"e\.csv: not text: byte 4 is 0xff"),
        ("e.csv", "1,2,3\n", {"channels": (4,)}, "has no channel 4; it has 3"),
        ("e.csv", "1,2,3\n", {"channels": (1, 1)}, "asked for twice"),
        ("e.npy", ROWS, {"channels": (4,)}, "has no channel 4; it has 3"),
        ("e.npy", np.zeros((2, 3, 4)), {}, r"of shape \(2, 3, 4\), expected \(samples, channels\)"),
        ("e.npy", np.array(["a"]), {}, "expected real numbers"),
        ("e.npy", b"\x93NUMPY broken", {}, r"not an \.npy array"),
        ("e.mat", {"data": ROWS, "raw": ROWS}, {}, "several arrays can be 'emg'; it has: data, raw"),
        ("e.mat", {"data": ROWS.ravel(), "datastart": [1, 4, 7]}, {"variable": "data"}, "behind each other"),
        ("e.mat", {"data": ROWS}, {"variable": "emgs"}, "has no variable 'emgs'; it has: data"),
        ("e.mat", b"no matlab, but long enough for a header" * 9, {}, r"not a MATLAB file|MATLAB 7\.3"),
    ],
)
def test_what_cannot_be_read_is_named(name, content, how, message, tmp_path):
    with pytest.raises(RecordingError, match=message):
        read(tmp_path / name, content, **how)


def test_a_mat_file_that_inflates_beyond_what_is_read_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("tega.runtime.files.formats.hdf5.MOST_MIB", 1)
    path = tmp_path / "e.mat"
    scipy.io.savemat(path, {"emg": ROWS, "big": np.zeros(200_000)}, do_compression=True)
    with pytest.raises(RecordingError, match="more than 1 MiB"):
        read_signals(path)


def test_a_mat_file_with_an_object_beside_the_samples_is_read(recordings: Path) -> None:
    path = recordings / "emg" / "my_thesis" / "recording_force_v1.mat"
    assert read_signals(path).samples.shape == (8803, 8)
    with pytest.raises(RecordingError, match="has no variable 'other'; it has: Force, "):
        read_signals(path, Reading(variable="other"))
    with pytest.raises(RecordingError, match=r"none\.csv: no such EMG file"):
        read_signals(path.with_name("none.csv"))


def test_chunks_are_stamped_with_the_time_of_their_last_sample(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", np.zeros((250, 2)))
    with EmgFile(EmgFileOptions(file=tmp_path / "e.npy", rate_hz=1000)) as source:
        chunks = [source.read(0) for _ in range(3)]
    assert [(c.t_ns, c.first_index, len(c.samples)) for c in chunks if c] == [
        (100_000_000, 0, 100),
        (200_000_000, 100, 100),
        (250_000_000, 200, 50),
    ]
