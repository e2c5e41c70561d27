"""Numbers of a run as LSL streams: heard by liblsl, written as XDF, read by pyxdf, equal to the recording."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.xdf_file import Received, write_xdf
from tega.config import check_tree
from tega.loop import run_session
from tega.recording.mcap_reader import McapReader
from tega.records import ArmMeasured, ArmTarget, ForearmPose
from tega.records.bus import Backlog, Bus
from tega_markers.lsl_streams import LslStreams

pylsl = pytest.importorskip("pylsl")
pyxdf = pytest.importorskip("pyxdf")
pytestmark = pytest.mark.slow

NAMES = ("/emg/samples", "/emg/levels", "/tactile/thumb/contact", "/vest/frame")


class Listener:
    """Hears some streams until told to stop."""

    def __init__(self, names: list[str]) -> None:
        self.received: dict[str, Received] = {}
        self._over = threading.Event()
        self._threads = [threading.Thread(target=self._receive, args=(name,)) for name in names]
        for thread in self._threads:
            thread.start()

    def _receive(self, name: str) -> None:
        found = pylsl.resolve_byprop("name", name, timeout=20.0)
        inlet = pylsl.StreamInlet(found[0], recover=False)
        inlet.open_stream(timeout=5.0)
        header = inlet.info().as_xml()
        samples: list[Any] = []
        times_s: list[float] = []
        while not self._over.is_set():
            try:
                more, at_s = inlet.pull_chunk(timeout=0.1)
            except pylsl.util.LostError:  # the run is over
                break
            samples += more
            times_s += at_s
        self.received[name] = Received(header, samples, times_s)

    def close(self) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join(10.0)


def test_poses_are_heard_with_their_places_and_turns(tmp_path: Path) -> None:
    zero_ns = time.monotonic_ns()
    bus, waiting = Bus(), Backlog("test")
    streams = LslStreams(("poses",), "tega-poses-test", bus, waiting, at_ns=lambda t_ns: zero_ns + t_ns)
    streams.begin(None)
    waiting.start()
    kinds = (ForearmPose, ArmMeasured, ArmTarget)
    listener = Listener([f"tega-poses-test{kind.topic}" for kind in kinds])
    try:
        for n in range(100):
            for kind in kinds:
                place, turn = (0.01 * n, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8)
                bus.publish(
                    kind(t_ns=n * 50_000_000, taken_ns=0, frame="base", position=place, quaternion=turn)
                )
            time.sleep(0.05)
    finally:
        waiting.close()
        time.sleep(0.3)  # what was sent last is on its way
        listener.close()
        streams.close()
    file = tmp_path / "poses.xdf"
    write_xdf(file, listener.received.values())
    received, _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    assert {s["info"]["name"][0] for s in received} == {f"tega-poses-test{kind.topic}" for kind in kinds}
    for stream in received:
        assert stream["info"]["type"][0] == "MoCap"
        rows = np.asarray(stream["time_series"])
        assert len(rows) > 20
        np.testing.assert_allclose(np.diff(rows[:, 0]), 0.01, atol=1e-12)  # in order, none lost
        np.testing.assert_array_equal(rows[:, 1:], np.tile([0.2, 0.3, 0.0, 0.0, 0.6, 0.8], (len(rows), 1)))
        # Of the records, not of their arrival.
        np.testing.assert_allclose(np.diff(stream["time_stamps"]), 0.05, atol=1e-6)


def test_what_liblsl_hears_is_what_is_recorded(tmp_path: Path) -> None:
    tree: dict[str, Any] = {
        "session": {"duration_s": 6.0},
        "tactile": {"thumb": {"driver": "synthetic-touch"}},
        "emg": {"driver": "synthetic-emg", "kind": "raw"},
        "recording": {"dir": str(tmp_path), "stop_free_mib": 0.0},
        "markers": {"lsl_out": "tega-streams-test", "lsl_streams": ["emg", "closure", "touch", "vest"]},
    }
    listener = Listener([f"tega-streams-test{name}" for name in NAMES])
    try:
        summary = run_session(check_tree(tree, {}, base=tmp_path).config)
    finally:
        listener.close()
    file = tmp_path / "heard.xdf"
    write_xdf(file, listener.received.values())
    streams, _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    by_name = {s["info"]["name"][0]: s for s in streams}
    assert set(by_name) == {f"tega-streams-test{name}" for name in NAMES}
    assert all(n > 0 for n in summary["markers"]["streams"].values())
    reader = McapReader(tmp_path / summary["recording"]["file"])
    records: dict[str, list[Any]] = {name: [] for name in NAMES}
    for message in reader.messages():
        if message.topic in records:
            records[message.topic].append(message.value)
    start_s = int(reader.metadata["tega"]["start_ns"]) / 1e9

    emg = by_name["tega-streams-test/emg/samples"]
    assert [c["label"][0] for c in emg["info"]["desc"][0]["channels"][0]["channel"]] == ["ch1", "ch2", "ch3"]
    assert float(emg["info"]["nominal_srate"][0]) > 0
    recorded = np.concatenate([np.reshape(list(m.samples), (-1, 3)) for m in records["/emg/samples"]])
    received = np.asarray(emg["time_series"])
    assert len(received) > 500
    # Streams find each other in about a second; from then on every sample is there, in order.
    (at,) = np.flatnonzero((recorded == received[0]).all(axis=1))[:1]
    np.testing.assert_array_equal(recorded[at : at + len(received)], received)

    levels = by_name["tega-streams-test/emg/levels"]
    labels = [c["label"][0] for c in levels["info"]["desc"][0]["channels"][0]["channel"]]
    reported = {round(m.t_ns): m.fused for m in records["/emg/levels"]}
    for t_s, row in zip(levels["time_stamps"], levels["time_series"], strict=True):
        nearest = min(reported, key=lambda t_ns: abs(t_ns / 1e9 + start_s - t_s))
        assert abs(nearest / 1e9 + start_s - t_s) < 0.001
        assert row[labels.index("fused")] == reported[nearest]

    touch = by_name["tega-streams-test/tactile/thumb/contact"]
    units = {
        c["label"][0]: (c["unit"] or [""])[0] for c in touch["info"]["desc"][0]["channels"][0]["channel"]
    }
    assert units["force_n"] == "N"
    assert units["depth_mm"] == "mm"
    column = list(units).index("cci")
    measured = {m.cci for m in records["/tactile/thumb/contact"]}
    assert {row[column] for row in touch["time_series"]} <= measured
    assert max(row[column] for row in touch["time_series"]) > 0
    assert len(by_name["tega-streams-test/vest/frame"]["time_series"][0]) == 40
