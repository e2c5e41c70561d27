"""The BrainFlow source on BrainFlow's own synthetic board, which is a real session of its library."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from tega.devices import driver_class
from tega.devices.brainflow_emg import BrainFlowEmg, BrainFlowOptions
from tega.errors import DeviceUnavailableError

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _with_brainflow() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import brainflow.board_shim  # noqa: F401
        except Exception as error:
            pytest.skip(f"BrainFlow does not load here ({error}): pip install 'tega[brainflow]'")


def source(**options: Any) -> BrainFlowEmg:
    make: Any = BrainFlowOptions
    return BrainFlowEmg(make(**{"board": "SYNTHETIC_BOARD", "measure_s": 0.5, **options}))


def test_samples_of_the_chosen_channels_come_without_a_gap() -> None:
    with source(channels=(2, 5)) as board:
        n, first = 0, board.read(1.0)
        assert first is not None
        at = first.first_index + len(first.samples)
        while n < 250:
            chunk = board.read(1.0)
            assert chunk is not None
            assert chunk.samples.shape[1] == 2
            assert chunk.first_index == at
            at += len(chunk.samples)
            n += len(chunk.samples)
            assert np.ptp(chunk.samples) >= 0
        assert board.info.rate_hz == 250.0
        assert board.info.channels == ("ch2", "ch5")
    with pytest.raises(DeviceUnavailableError, match="not open"):
        board.read(0.0)


def test_a_gap_of_the_counter_is_missing_samples() -> None:
    board = source()
    board._counter_row = 0
    counts = np.array([[254.0, 255.0, 0.0, 3.0]])
    missing = board._missing(counts)
    assert missing is not None
    assert missing.tolist() == [0, 0, 0, 2]
    again = board._missing(np.array([[3.0, 5.0]]))
    assert again is not None
    assert again.tolist() == [255, 1]


WRONG = [
    ({"board": "MINE"}, "no board is called 'MINE'.*CYTON_BOARD"),
    (
        {"board": "CYTON_BOARD", "serial_port": "/dev/nowhere"},
        "CYTON_BOARD does not start: UNABLE_TO_OPEN_PORT",
    ),
    ({"channels": (1, 17)}, r"has 16 channels, asked for \[1, 17\]"),
]


@pytest.mark.parametrize(("options", "said"), WRONG)
def test_opening_says_what_is_wrong(options: dict[str, Any], said: str) -> None:
    with pytest.raises(DeviceUnavailableError, match=said):
        source(**options).open()


def test_it_is_listed_and_opens_again_after_a_failure() -> None:
    assert driver_class("brainflow", "emg") is BrainFlowEmg
    board = source(channels=(99,))
    with pytest.raises(DeviceUnavailableError):
        board.open()
    with source() as fine:
        assert fine.read(1.0) is not None
