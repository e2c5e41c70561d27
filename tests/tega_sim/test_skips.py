"""A vest is not told twice, and what is not there costs nothing."""

from __future__ import annotations

import csv
import importlib
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import observed
from reference.scripted import MS, Sink, touching
from reference.wired import wired_loop
from tega.config import check_tree
from tega.config.calibration import TouchMaxima
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega.loop.inbox.stream import PulledStream
from tega.loop.loop import DualLoop
from tega.loop.pacing import Pacer
from tega.loop.snapshot import LoopView
from tega.loop.touch import TouchLoop
from tega.records import Intent
from tega.runtime.clock import ManualClock
from tega_sim.gel import Gel


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


class Waits(ManualClock):
    def __init__(self) -> None:
        super().__init__()
        self.times: list[int] = []

    def sleep_until(self, t_ns: int) -> None:
        self.times.append(t_ns)
        super().sleep_until(t_ns)


def run_parts(
    *, touch: bool, emg: bool, live: Sink | None = None, recorder: Sink | None = None, **how: Any
) -> tuple[DualLoop, Waits, Sink, Sink]:
    clock, vest, hand = Waits(), recorder or Sink(), Sink()
    contacts = [touching(50, t_ns=k * 16 * MS) for k in range(61)] if touch else []
    levels = [Intent(t_ns=k * 100 * MS, channels=(2,), level=2) for k in range(1, 10)]
    streams = {"thumb": PulledStream(contacts, end_ns=1000 * MS)} if touch else {}
    loop = wired_loop(
        Pacer(clock),
        TouchLoop(dict.fromkeys(streams, TouchMaxima(cci_max=1.0, eda_max=100.0)), layout="x40"),
        contacts=streams,
        levels=PulledStream(levels, end_ns=1000 * MS) if emg else None,
        vests=[vest],
        hands=[hand],
        live_vests=[live or vest],
    )
    loop.run(**how)
    return loop, clock, vest, hand


def test_a_vest_that_fails_does_not_keep_the_others_from_silence() -> None:
    recorder = Sink()
    with pytest.raises(DeviceUnavailableError, match="cable"):
        run_parts(touch=True, emg=False, live=Sink(fail_at_ns=50 * MS), recorder=recorder)
    assert not recorder.sent[-1][1].intensities.any()


VEST_TIMES = [round(k * 1e9 / 30) for k in range(30)]


def test_without_emg_no_hand_ticks_and_nobody_wakes_for_it() -> None:
    loop, clock, _, hand = run_parts(touch=True, emg=False)
    assert [t for t, _ in hand.sent] == [1000 * MS]  # the way out
    assert (loop.report.n_hand_ticks, loop.report.n_vest_ticks) == (0, 30)
    assert (loop.report.n_contacts, loop.report.end_ns) == ({"thumb": 61}, 1000 * MS)
    assert clock.times == sorted({*VEST_TIMES, *range(0, 1001 * MS, 100 * MS)})


def test_without_touch_no_vest_ticks_and_nobody_wakes_for_it() -> None:
    loop, clock, vest, hand = run_parts(touch=False, emg=True)
    assert [t for t, _ in vest.sent] == [1000 * MS] * 2  # the way out of both sinks
    assert (loop.report.n_hand_ticks, loop.report.n_vest_ticks) == (334, 0)
    assert clock.times == [*range(0, 1000 * MS, 3 * MS), 1002 * MS]
    assert len(hand.sent) == 335


def test_a_set_duration_is_kept_and_takes_in_all_that_came_before_it() -> None:
    loop, clock, vest, _ = run_parts(touch=True, emg=False, duration_ns=97 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("duration", 97 * MS)
    assert clock.times[-1] == 97 * MS
    assert loop.report.n_contacts == {"thumb": 7}  # at 0, 16, … 96 ms
    assert vest.sent[-1][0] == 97 * MS
    loop, *_ = run_parts(touch=True, emg=False, duration_ns=1000 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("duration", 1000 * MS)
    loop, *_ = run_parts(touch=True, emg=False, duration_ns=1001 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("complete", 1000 * MS)


PLUGIN = """
from tega.devices.base import DeviceInfo
from tega_sim.synthetic import SyntheticTouch
from tega.devices.vest.vest_recorder import VestRecorder

made, read = [], []

class Driver(SyntheticTouch):
    def __init__(self, options):
        super().__init__(options)
        made.append(self)

    def read(self, timeout_s):
        read.append(self)
        return super().read(timeout_s)

class LiveVest(VestRecorder):
    @property
    def info(self):
        return DeviceInfo(driver="live-vest", kind="vest", label="written down", live=True)
"""


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Install a tactile driver that remembers its instances and a vest that counts as a real one."""
    folder = tmp_path / "site"
    info = folder / "tega_test_skips-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "tega_test_skips.py").write_text(PLUGIN)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tega_test_skips\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[tega.devices]\ncounted-touch = tega_test_skips:Driver\nlive-vest = tega_test_skips:LiveVest\n"
    )
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "tega_test_skips", raising=False)
    return importlib.import_module("tega_test_skips")


def session(tmp_path: Path, out: str, **tables: Any) -> Any:
    tree = {
        "session": {"pace": "fast", "out_dir": str(tmp_path / out)},
        "tactile": {"index": {"driver": "counted-touch", "options": {"duration_s": 2.0}}},
        **tables,
    }
    return check_tree(tree, {}, base=tmp_path).config


def our_threads() -> set[str]:
    return {t.name for t in threading.enumerate() if t.name.startswith("tega-")}


def test_a_session_of_one_finger_knows_no_other(plugin: Any, tmp_path: Path) -> None:
    while_measuring: set[str] = set()
    views: list[LoopView] = []
    running: set[str] = set()

    def progress(_subject: str, _done: int, _total: int) -> None:
        while_measuring.update(our_threads())

    def observer(view: LoopView) -> None:
        views.append(view)
        running.update(our_threads())

    first = run_session(session(tmp_path, "one"), progress=progress, bus=observed(observer))
    assert len(plugin.made) == 1
    assert plugin.read == plugin.made * len(plugin.read)
    assert while_measuring == {"tega-index"}  # the finger's own
    assert running == set()  # all was measured beforehand

    plugin.made.clear()
    plugin.read.clear()
    calibration = {"file": str(tmp_path / "one" / "calibration.toml")}
    np.save(tmp_path / "gel.npy", Gel(0).still())
    finger = {"driver": "counted-touch", "baseline": "gel.npy", "options": {"duration_s": 2.0}}
    config = session(tmp_path, "two", calibration=calibration, tactile={"index": finger})
    second = run_session(config, bus=observed(observer))
    assert len(plugin.made) == 1
    assert len(plugin.read) == 120 + 5  # each once, and five before to compare the baseline with
    assert running <= {"tega-index", "tega-recordings"}  # one reads, one measures
    assert our_threads() == set()
    for summary in (first, second):
        assert list(summary["tactile"]) == ["index"]
        assert (summary["emg"], summary["hand"]["ticks"]) == (None, 0)
    assert set().union(*(view.contacts for view in views)) == {"index"}
    rows = table(tmp_path / "two" / "contacts.csv")
    assert {row["finger"] for row in rows} == {"index"}
    assert "[tactile.index]" in (tmp_path / "one" / "calibration.toml").read_text()
    assert "thumb" not in (tmp_path / "one" / "calibration.toml").read_text()


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize(("driver", "n_sent"), [("live-vest", 60), ("vest-recorder", 0)])
def test_a_vest_that_does_not_spare_itself_gets_every_frame(tmp_path: Path, driver: str, n_sent: int) -> None:
    vest = {"driver": driver, "options": {"file": "mine.csv"}}
    text = run_session(session(tmp_path, "out", vest=vest))["vest"]
    assert text["sinks"] == [driver, "vest-recorder"]
    assert (text["frames"], text["sent"], text["skipped"]) == (60, n_sent, 0)
    assert (tmp_path / "mine.csv").read_bytes() == (tmp_path / "out" / "vest.csv").read_bytes()
