"""EMG files as people have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from numpy.typing import NDArray

from tega.devices.emg.emg_file import EmgFile, EmgFileOptions
from tega.errors import RecordingError
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading


def read_emg_file(
    path: Path, channels: tuple[int, ...] = (), variable: str = "emg"
) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Return samples and channels of a file."""
    signals = read_signals(path, Reading(channels=channels, variable=variable))
    return signals.samples, signals.channels


ROWS = np.array([[1.0, -2.5, 3e-4], [4.0, 5.0, -6.0], [7.0, 8.25, 9.0]])


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
    path = tmp_path / "emg.txt"
    path.write_text(text, encoding="utf-8", newline="")
    samples, channels = read_emg_file(path)
    np.testing.assert_array_equal(samples, ROWS)
    assert channels == (1, 2, 3)


def test_channels_are_counted_from_one_in_the_order_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "emg.csv"
    path.write_text("1,2,3\n4,5,6\n")
    samples, channels = read_emg_file(path, (3, 1))
    np.testing.assert_array_equal(samples, [[3, 1], [6, 4]])
    assert channels == (3, 1)


def test_only_the_wanted_columns_have_to_be_numbers(tmp_path: Path) -> None:
    path = tmp_path / "emg.csv"
    path.write_text("time,emg\n12:30:01,5\n12:30:02,nan\n")
    samples, _ = read_emg_file(path, (2,))
    np.testing.assert_array_equal(samples, [[5.0], [np.nan]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3,x\n", r"emg\.csv:2: not a row of numbers: '3,x'; fix or delete"),
        ("1,2\n3,4,5\n", r"emg\.csv:2: 3 cells, the lines before have 2: '3,4,5'"),
        ("1,2\n3\n", r"emg\.csv:2: 1 cells, the lines before have 2: '3'"),
        ("1,2\n1_0,3\n", r"emg\.csv:2: not a row of numbers: '1_0,3'"),
        ("1,x\n2,3\n", r"emg\.csv:1: not a row of numbers: '1,x'"),
        ("a,b\nc,d\n", r"emg\.csv:2: not a row of numbers: 'c,d'"),
        ("# nothing\n", r"emg\.csv: holds no sample"),
        ("a,b\n", r"emg\.csv: holds no sample"),
        ("", r"emg\.csv: holds no sample"),
    ],
)
def test_a_line_that_cannot_be_parsed_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "emg.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        read_emg_file(path)


def test_binary_bytes_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "emg.csv"
    path.write_bytes(b"1,2\n\xff\xfe\n")
    with pytest.raises(RecordingError, match=r"emg\.csv: not text: byte 4 is 0xff"):
        read_emg_file(path)


def test_npy_and_mat_give_the_same_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", ROWS)
    scipy.io.savemat(tmp_path / "e.mat", {"emg": ROWS, "Force": np.arange(3.0)})
    for name in ("e.npy", "e.mat"):
        samples, _ = read_emg_file(tmp_path / name, (2,))
        np.testing.assert_array_equal(samples, ROWS[:, [1]])


def test_one_channel_may_come_as_a_plain_row_of_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", np.arange(4, dtype=np.int16))
    samples, channels = read_emg_file(tmp_path / "e.npy")
    assert (samples.shape, channels) == ((4, 1), (1,))
    assert samples.dtype == np.float64


def test_what_arrays_cannot_be_is_said(tmp_path: Path) -> None:
    path = tmp_path / "e.npy"
    np.save(path, np.zeros((2, 3, 4)))
    with pytest.raises(
        RecordingError, match=r"an array of shape \(2, 3, 4\), expected \(samples, channels\)"
    ):
        read_emg_file(path)
    np.save(path, np.zeros((100, 130)))
    with pytest.raises(RecordingError, match=r"100 rows and 130 columns: .*set rows to samples"):
        read_emg_file(path)
    np.save(path, np.array(["a"]))
    with pytest.raises(RecordingError, match="expected real numbers"):
        read_emg_file(path)
    path.write_bytes(b"\x93NUMPY broken")
    with pytest.raises(RecordingError, match=r"not an \.npy array"):
        read_emg_file(path)


def test_mat_files_name_what_they_have(tmp_path: Path) -> None:
    path = tmp_path / "e.mat"
    scipy.io.savemat(path, {"data": ROWS, "raw": ROWS})
    with pytest.raises(RecordingError, match=r"several arrays can be 'emg'; it has: data, raw"):
        read_emg_file(path)
    with pytest.raises(RecordingError, match=r"has no variable 'emgs'; it has: data, raw"):
        read_emg_file(path, variable="emgs")
    assert read_emg_file(path, variable="data")[0].shape == (3, 3)
    path.write_bytes(b"no matlab at all, but long enough to look like a header" * 5)
    with pytest.raises(RecordingError, match=r"not a MATLAB file|MATLAB 7\.3"):
        read_emg_file(path)


def test_a_mat_file_that_inflates_beyond_what_is_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tega.runtime.files.formats.hdf5.MOST_MIB", 1)
    path = tmp_path / "e.mat"
    scipy.io.savemat(path, {"emg": ROWS, "big": np.zeros(200_000)}, do_compression=True)
    with pytest.raises(RecordingError, match="more than 1 MiB"):
        read_emg_file(path)


def test_a_mat_file_with_an_object_beside_the_samples_is_read(recordings: Path) -> None:
    path = recordings / "emg" / "my_thesis" / "recording_force_v1.mat"
    assert read_emg_file(path)[0].shape == (8803, 8)
    with pytest.raises(RecordingError, match="has no variable 'other'; it has: Force, "):
        read_emg_file(path, variable="other")


@pytest.mark.parametrize(
    ("channels", "message"), [((4,), "has no channel 4; it has 3"), ((1, 1), "asked for twice")]
)
def test_channels_that_are_not_there(tmp_path: Path, channels: tuple[int, ...], message: str) -> None:
    np.save(tmp_path / "e.npy", ROWS)
    (tmp_path / "e.csv").write_text("1,2,3\n")
    for name in ("e.npy", "e.csv"):
        with pytest.raises(RecordingError, match=message):
            read_emg_file(tmp_path / name, channels)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.csv: no such EMG file"):
        read_emg_file(tmp_path / "none.csv")


def test_chunks_are_stamped_with_the_time_of_their_last_sample(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", np.zeros((250, 2)))
    with EmgFile(EmgFileOptions(file=tmp_path / "e.npy", rate_hz=1000)) as source:
        chunks = [source.read(0) for _ in range(3)]
    assert [(c.t_ns, c.first_index, len(c.samples)) for c in chunks if c] == [
        (100_000_000, 0, 100),
        (200_000_000, 100, 100),
        (250_000_000, 200, 50),
    ]
