"""Live EMG in the loop: missing samples take their time, and a run survives its source."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.kept import muscle_file
from reference.parts import Given, observed
from tega.config import SessionConfig, check_tree
from tega.config.calibration import EmgMaxima
from tega.devices.base import DeviceInfo, EmgChunk
from tega.loop.inbox.sources import BlockMeter, SourceReport, grasp_blocks
from tega.loop.session import run_session
from tega.stages.base import MuscleSetup
from tega.stages.decoders import RulesDecoder, RulesOptions
from tega_emulators.process import Emulator


class Gappy:
    """A source whose samples come in chunks with given numbers."""

    def __init__(self, chunks: list[EmgChunk]) -> None:
        self._chunks = chunks
        self.info = DeviceInfo(driver="gappy", kind="emg", label="gappy", live=True, channels=("ch1",))

    @property
    def ended(self) -> bool:
        return not self._chunks

    def read(self, timeout_s: float) -> EmgChunk:  # noqa: ARG002
        return self._chunks.pop(0)


def test_missing_samples_take_their_time() -> None:
    # 100 samples, 350 missing, 100 samples, at 500 Hz in blocks of 50: eleven blocks of time.
    ones = np.ones((100, 1))
    source: Any = Gappy([EmgChunk(200_000_000, 0, ones), EmgChunk(1_100_000_000, 450, ones)])
    setup = MuscleSetup("envelope", 500.0, 50, ("a",), (1.0,), "paper")
    report = SourceReport()
    maxima = EmgMaxima(kind="envelope", rate_hz=500.0, tau=50, channels=("a",), maxima=(1.0,))
    meter = BlockMeter(RulesDecoder(setup, RulesOptions()), report, maxima=maxima, live=source.info.live)
    blocks = list(grasp_blocks(source, meter))
    assert (report.n_items, report.n_missing) == (200, 350)
    assert len(blocks) == 11
    assert [block.channels[0] for block in blocks][:2] == [5, 5]
    # Bad from the first block that lies in the gap, until 100 ms of good samples have come.
    assert 0 in [block.channels[0] for block in blocks]
    assert [block.level for block in blocks] == [5] * 11


def _settings(folder: Path, port: str, *, duration_s: float) -> SessionConfig:
    """Return the settings of a run on a calibrated Cyton."""
    tree: dict[str, Any] = {
        "session": {"duration_s": duration_s, "out_dir": str(folder / "out")},
        "calibration": {"file": str(muscle_file(folder, 300.0, 300.0, 300.0, rate_hz=250.0))},
        "emg": {"driver": "cyton", "kind": "raw", "options": {"port": port, "measure_s": 0.25}},
    }
    return check_tree(tree, {}, base=folder).config


@pytest.mark.slow
def test_a_run_on_a_board_that_is_unplugged_ends_in_order(tmp_path: Path) -> None:
    with Emulator("cyton", "--signal", "emg", "--fault", "loss=0.02") as device:
        config = _settings(tmp_path, device.port, duration_s=2.5)
        unplugged: list[bool] = []

        def watch(view: Any) -> None:
            if view.t_ns > 1_500_000_000 and not unplugged:
                unplugged.append(True)
                device.say("unplug")

        summary = run_session(config, bus=observed(watch))
    notes = " ".join(summary["notes"])
    assert "emg: lost: cyton: " in notes
    assert "was lost" in notes
    assert "its last level held for 2 s, then the hand opens" in notes
    assert "Cyton firmware v3.1.2, gain 24" in notes
    assert summary["emg"]["samples"] > 100
    assert (tmp_path / "out" / "can.csv").read_text().splitlines()[-1].endswith("104,")


@pytest.mark.slow
def test_a_page_that_asks_all_the_time_does_not_disturb_the_reader(tmp_path: Path) -> None:
    """Another thread asks the source for its notes as fast as it can, as the page's painter once did."""
    over, failed, requested = threading.Event(), list[BaseException](), [0]

    def ask(source: Any, intent: Any) -> None:
        try:
            while not over.is_set():
                assert source.info.unit == "µV"
                assert len(intent.full_scale) == 3
                requested[0] += 1
        except BaseException as error:
            failed.append(error)

    with Emulator("cyton", "--signal", "emg", "--fault", "loss=0.02") as device:
        config = _settings(tmp_path, device.port, duration_s=3.0)
        askers: list[threading.Thread] = []

        def prepared(prepared: Any) -> Any:
            muscles = prepared.muscles
            askers.append(threading.Thread(target=ask, args=(muscles.source, muscles.decoder)))
            askers[0].start()
            return prepared

        try:
            summary = run_session(config, parts=[Given(prepared)])
        finally:
            over.set()
            for asker in askers:
                asker.join()
    assert not failed
    assert requested[0] > 100
    assert summary["ended"] == "duration"
    assert "emg: lost" not in str(summary)
