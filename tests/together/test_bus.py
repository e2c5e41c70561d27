"""The bus delivers what is published, in order; who fails or is slow costs nobody else anything."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import pytest

from reference.played import finger, muscles
from reference.processes import until
from reference.sessions import tree
from tega.config import check_tree
from tega.loop import LoopView, Snapshot, run_session
from tega.recording.replay import replay_file
from tega.records import Alert, Contact, Intent, Record, RunState, VestFrame
from tega.records.bus import DROPS_REPORTED_S, Backlog, Bus, report_drops


def session(folder: Path) -> dict[str, Any]:
    settings = tree(folder / "session")
    del settings["tactile"]["ring"]
    settings["tactile"]["thumb"], settings["emg"] = finger(0.3), muscles(0.3)
    return settings


def state(t_ns: int) -> RunState:
    return RunState(t_ns=t_ns, state="active", reason="")


def test_records_come_in_the_order_they_are_published_to_subscribers_in_theirs() -> None:
    bus, reported = Bus(), list[tuple[int, str, int]]()
    bus.subscribe(Record, lambda r: reported.append((0, r.where, r.log_ns)))
    bus.subscribe(Record, lambda r: reported.append((1, r.where, r.log_ns)))
    bus.subscribe(Alert, lambda r: reported.append((2, r.where, r.log_ns)))
    bus.publish(state(1))
    bus.publish(Alert(t_ns=2, name="x", said="y"))
    assert reported == [(k, "/run/state", 1) for k in (0, 1)] + [(k, "/run/alert", 2) for k in (0, 1, 2)]


def test_nobody_makes_a_record_that_nobody_wants() -> None:
    bus = Bus()
    assert not bus.wants(Contact)
    bus.subscribe(Intent, lambda _intent: None)
    assert (bus.wants(Contact), bus.wants(Intent)) == (False, True)
    recorded, displayed = list[Record](), list[Snapshot]()
    bus.subscribe(Record, recorded.append)
    assert (bus.wants(Contact), bus.wants(Snapshot)) == (True, False)
    bus.subscribe(Snapshot, displayed.append)
    view = LoopView(0, {}, None, None, None, {})
    bus.publish(Snapshot(t_ns=0, view=view))
    assert ([snapshot.view for snapshot in displayed], recorded) == ([view], [])


def test_who_fails_is_told_of_once_and_left_out_and_the_others_go_on(caplog):
    bus, reported = Bus(), list[int]()

    def fails(record: RunState) -> None:
        if record.t_ns == 2:
            raise OSError(28, "No space left on device")
        reported.append(-record.t_ns)

    bus.subscribe(RunState, fails, name="disk")
    bus.subscribe(RunState, lambda record: reported.append(record.t_ns), name="page")
    for t_ns in (1, 2, 3):
        bus.publish(state(t_ns))
    assert reported == [-1, 1, 2, 3]
    assert bus.problem() == "disk: No space left on device"
    assert caplog.messages == ["disk: No space left on device; the run goes on"]


def test_a_vital_subscriber_s_failure_is_the_publisher_s() -> None:
    bus = Bus()
    bus.subscribe(RunState, lambda record: [][record.t_ns], vital=True)
    with pytest.raises(IndexError):
        bus.publish(state(1))


def test_a_slow_subscriber_keeps_nobody_waiting_and_what_is_dropped_is_counted_and_told() -> None:
    bus, reported, go, backlog = Bus(), list[int](), threading.Event(), Backlog("table", most=10)

    def slow(record: RunState) -> None:
        go.wait(30)
        reported.append(record.t_ns)

    bus.subscribe(RunState, slow, name="table", backlog=backlog)
    for t_ns in range(50):
        bus.publish(state(t_ns))  # returns, though nothing is taken
    assert reported == []
    n_dropped = backlog.n_dropped
    assert n_dropped in {39, 40}  # one may be in its hands
    assert bus.problem() == f"table: {n_dropped} records dropped, it does not keep up"
    go.set()
    backlog.close()
    assert reported == list(range(50 - n_dropped))


def test_dropped_records_are_told_for_ten_seconds_after_the_last_one() -> None:
    now_s = time.monotonic()
    assert report_drops(3, now_s) == "3 records dropped"
    assert report_drops(3, now_s - DROPS_REPORTED_S - 0.001) == ""
    assert report_drops(0, now_s) == ""


def test_one_that_fails_behind_a_backlog_is_left_out_too() -> None:
    bus, calls = Bus(), list[int]()
    backlog = Backlog("table")

    def fails(record: RunState) -> None:
        calls.append(record.t_ns)
        raise ValueError("no such column")

    bus.subscribe(RunState, fails, name="table", backlog=backlog)
    for t_ns in range(5):
        bus.publish(state(t_ns))
    backlog.close()
    assert calls == [0]
    assert bus.problem() == "table: ValueError: no such column"


@pytest.mark.raises("subscribers")
def test_a_run_whose_onlookers_fail_does_and_records_the_same(tmp_path: Path) -> None:
    bus, seen = Bus(), list[str]()
    bus.subscribe(Contact, lambda record: [][record.t_ns], name="display")
    bus.subscribe(VestFrame, lambda record: seen.append(record.where))
    summary = run_session(check_tree(session(tmp_path), {}, base=tmp_path).config, bus=bus)
    assert summary["ended"] == "complete"
    assert set(seen) == {"/vest/frame"}
    assert summary["safety"]["alerts"] == ["display: IndexError: list index out of range"]
    assert replay_file(tmp_path / "session" / summary["recording"]["file"]).same


def test_a_recorder_that_fails_is_told_and_ends_no_run(tmp_path, monkeypatch):
    from tega.recording.record_channels import McapFile

    original, files = McapFile.write, set[McapFile]()

    def write(file: McapFile, record: Record, t_ns: int) -> None:
        files.add(file)
        if isinstance(record, Contact) and record.t_ns > 0:
            raise ValueError("a mistake in the recorder")
        original(file, record, t_ns)

    monkeypatch.setattr(McapFile, "write", write)
    summary = run_session(check_tree(session(tmp_path), {}, base=tmp_path).config)
    assert summary["ended"] == "complete"
    assert summary["recording"]["state"] == "stopped"
    assert "a mistake in the recorder" in summary["recording"]["reason"]
    for file in files:
        file.close()  # a stopped recorder leaves it to the next start


def test_a_backlog_for_the_newest_drops_the_oldest_and_tells_how_long_the_rest_waited() -> None:
    seen, idle = list[int](), list[int]()
    backlog = Backlog("view", most=2, newest=True, idle=lambda: idle.append(1))
    for k in range(5):
        backlog.put(lambda to, record: to.append(record), seen, k)
    assert (backlog.n_put, backlog.n_dropped, backlog.problem()) == (5, 3, "")
    backlog.start()
    backlog.close()
    assert seen == [3, 4]
    assert backlog.waited_s > 0
    backlog.start()  # a display that is opened again
    until(lambda: bool(idle))
    backlog.put(lambda to, record: to.append(record), seen, 5)
    backlog.close()
    assert seen == [3, 4, 5]
    assert not backlog.running
