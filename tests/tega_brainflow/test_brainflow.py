"""BrainFlow as a source and as a peer: its own synthetic board, its Cyton board on our emulator, and its streaming."""

from __future__ import annotations

import itertools
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from reference.emg_boards import CYTON_STEP_UV, chunks_of, phases
from tega.devices.emg.cyton import Cyton, CytonOptions
from tega.devices.emg.live_emg import LiveEmg
from tega.errors import DeviceUnavailableError, StreamContradictionError
from tega.runtime.evidence import StampCheck
from tega_brainflow.emg import BrainFlowEmg, BrainFlowOptions
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _with_brainflow() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import brainflow.board_shim  # noqa: F401
        except Exception as error:
            pytest.skip(f"BrainFlow does not load here ({error}): pip install 'tega[brainflow]'")


def assert_whole(board: LiveEmg) -> None:
    """Read a second of the emulator's ramp without a gap."""
    phase, exact = phases("cyton", chunks_of(board, 250))
    assert exact.all()
    assert (phase == phase[0]).all()


@contextmanager
def streaming(port: str, *, to: str = "") -> Iterator[Any]:
    """Run BrainFlow's own Cyton board on a port; with ``to`` it passes its samples on."""
    from brainflow.board_shim import BoardIds, BoardShim, BrainFlowInputParams

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it imports pkg_resources when its library is loaded
        BoardShim.disable_board_logger()
    parameters = BrainFlowInputParams()
    parameters.serial_port = port
    board = BoardShim(BoardIds.CYTON_BOARD.value, parameters)
    board.prepare_session()
    try:
        if to:
            board.add_streamer(f"streaming_board://{to}")
        board.start_stream()
        yield board
    finally:
        board.release_session()


def test_brainflow_s_own_cyton_board_reads_the_emulated_one_as_our_driver_does() -> None:
    with Emulator("cyton") as device:
        with streaming(device.port) as board:
            while board.get_board_data_count() < 400:
                time.sleep(0.05)
            table = board.get_board_data()
        assert bytes.fromhex(device.say("heard")["heard"]).endswith(b"bs")
        rows = board.get_board_descr(board.board_id)
        numbers = np.arange(table.shape[1])
        assert np.array_equal(table[rows["package_num_channel"]], numbers % 256)
        ramp = (numbers + 100 * np.arange(8)[:, np.newaxis]) % 1000 - 500
        assert np.allclose(table[rows["emg_channels"]], ramp * CYTON_STEP_UV, rtol=1e-12, atol=1e-9)
        with Cyton(CytonOptions(port=device.port, channels=tuple(range(1, 9)), measure_s=0.5)) as ours:
            assert_whole(ours)


def test_our_driver_reads_a_cyton_through_brainflow() -> None:
    with Emulator("cyton") as device, source(board="CYTON_BOARD", serial_port=device.port) as ours:
        assert ours.info.rate_hz == 250.0
        assert_whole(ours)


def test_a_daisy_that_brainflow_does_not_know_of_is_refused() -> None:
    with (
        Emulator("cyton", "--signal", "emg", "--daisy", "hidden") as device,
        pytest.raises(StreamContradictionError, match="values: packets of even and of odd number"),
    ):
        source(board="CYTON_BOARD", serial_port=device.port).open()


def test_samples_that_brainflow_holds_back_are_reported() -> None:
    with source() as board:
        board._stamps = StampCheck()
        assert [board._late(time.time() - 2.0) for _ in range(2)] == [None, None]
        time.sleep(0.6)
        contradiction = board._late(time.time() - 2.0)
    assert contradiction is not None
    assert "samples are read 2.00 s after BrainFlow had them" in contradiction.found


def test_our_driver_reads_what_another_program_streams_by_brainflow() -> None:
    place = {"ip_address": "225.1.1.1", "ip_port": 6677}
    with (
        Emulator("cyton") as device,
        streaming(device.port, to="225.1.1.1:6677"),
        source(board="STREAMING_BOARD", master_board="CYTON_BOARD", **place) as ours,
    ):
        assert len(ours.info.channels) == 8
        assert_whole(ours)


def source(**options: Any) -> BrainFlowEmg:
    make: Any = BrainFlowOptions
    return BrainFlowEmg(make(**{"board": "SYNTHETIC_BOARD", "measure_s": 0.5, **options}))


def test_samples_of_the_chosen_channels_come_without_a_gap() -> None:
    with source(channels=(2, 5)) as board:
        chunks = chunks_of(board, 250)
        for chunk, following in itertools.pairwise(chunks):
            assert following.first_index == chunk.first_index + len(chunk.samples)
        assert {chunk.samples.shape[1] for chunk in chunks} == {2}
        assert board.info.rate_hz == 250.0
        assert board.info.channels == ("ch2", "ch5")
    with pytest.raises(DeviceUnavailableError, match="not open"):
        board.read(0.0)


def test_a_gap_of_the_counter_is_missing_samples() -> None:
    board = source()
    board._counter_row = 0
    for counts, missing in (([254.0, 255.0, 0.0, 3.0], [0, 0, 0, 2]), ([3.0, 5.0], [255, 1])):
        found = board._missing(np.array([counts]))
        assert found is not None
        assert found.tolist() == missing


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"board": "MINE"}, "no board is called 'MINE'.*CYTON_BOARD"),
        ({"board": "CYTON_BOARD", "serial_port": "/dev/nowhere"}, "does not start: UNABLE_TO_OPEN_PORT"),
        ({"board": "STREAMING_BOARD", "master_board": "MINE"}, "no board is called 'MINE'"),
        ({"channels": (1, 17)}, r"has 16 channels, asked for \[1, 17\]"),
    ],
)
def test_opening_says_what_is_wrong(options: dict[str, Any], text: str) -> None:
    with pytest.raises(DeviceUnavailableError, match=text):
        source(**options).open()
