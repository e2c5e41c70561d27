"""Columns of a table that are no muscle, and what is said of files that cannot be used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tega.emg import ButterworthLowpass, GraspIntent, grasp_level
from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading
from tega.ui.cli.main import main


@pytest.mark.parametrize(
    ("names", "text", "rest"),
    [
        ("Force,ch1,ch2", '"Force" is another sensor', (2, 3)),
        ("time_s,ECR,FCU", '"time_s" is time', (2, 3)),
        ("ECR,FCU,Force (N)", '"Force (N)" is another sensor', (1, 2)),
        ("timestamp,ch1,label", '"timestamp" is time, "label" is a label', (2,)),
    ],
)
def test_a_column_that_is_no_muscle_is_left_out_and_named(
    names: str, text: str, rest: tuple[int, ...], tmp_path: Path
) -> None:
    file = tmp_path / "squeeze.csv"
    file.write_text(f"{names}\n1,2,3\n4,5,6\n")
    signals = read_signals(file)
    assert signals.channels == rest
    assert text in signals.decision.words
    # A channel that is named is meant.
    assert read_signals(file, Reading(channels=(1, 2))).samples.tolist() == [[1.0, 2.0], [4.0, 5.0]]


def test_names_of_muscles_are_read_as_ever(tmp_path: Path) -> None:
    file = tmp_path / "squeeze.csv"
    file.write_text("ECR,FCU,FDS\n1,2,3\n")
    assert read_signals(file).channels == (1, 2, 3)


def test_emg_score_asks_which_columns_are_emg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "squeeze.csv"
    np.savetxt(file, np.random.default_rng(1).normal(size=(4000, 4)), delimiter=",")
    with pytest.raises(SystemExit) as left:
        main(["emg", "score", str(file), "--force", "1", "--rate-hz", "200"])
    assert left.value.code == 2
    assert "--force 1 is a column beside the EMG: name that with --channels" in capsys.readouterr().err


def test_hints_name_no_option_of_another_command(tmp_path: Path) -> None:
    import scipy.io

    table, mat = tmp_path / "a.csv", tmp_path / "a.mat"
    table.write_text("1,2,3\n3,4\n")
    scipy.io.savemat(mat, {"a1": np.zeros((3, 3)), "a2": np.zeros((3, 3))})
    for file in (table, mat):
        with pytest.raises(RecordingError) as caught:
            read_signals(file)
        assert "--" not in caught.value.hint, caught.value.hint


def test_numbers_in_errors_are_short() -> None:
    for refused in (
        lambda: grasp_level(1.0, -1e300),
        lambda: ButterworthLowpass(1e300, 1e-300, 2, 1),
    ):
        with pytest.raises((InvalidValueError, ValueError)) as caught:
            refused()
        assert len(str(caught.value)) < 250


def test_a_rate_that_is_too_slow_is_told_what_is_fast_enough() -> None:
    with pytest.raises(InvalidValueError) as caught:
        GraspIntent(20.0, [1.0], tau=2)
    assert "125 samples/s" in caught.value.hint
    assert "another cutoff" not in str(caught.value)
