"""Events of touch are records: recorded, tabled, shown, marked and found again by a replay."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.parts import observed
from tega.config import check_tree
from tega.config.calibration import TouchMaxima
from tega.loop import run_session
from tega.loop.snapshot import LoopView
from tega.loop.touch import TouchLoop
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.records import ArmTurn, Contact, Event, PoseNumbers
from tega.records.bus import Bus
from tega.records.schema import read
from tega.records.table import columns, rows
from tega.ui.view.browser.state_html import status_html
from tega.ui.view.state import ViewState

TREE: dict[str, Any] = {
    "session": {"preset": "live", "pace": "fast", "duration_s": 4.0},
    "tactile": {"index": {"driver": "synthetic-touch"}},
}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, list[Event], list[LoopView]]:
    folder = tmp_path_factory.mktemp("events")
    tree = TREE | {
        "session": TREE["session"] | {"out_dir": str(folder / "out")},
        "recording": {"dir": str(folder / "recorded"), "lossless": True, "stop_free_mib": 0.0},
    }
    bus, received, seen = Bus(), list[Event](), list[LoopView]()
    bus.subscribe(Event, received.append)
    summary = run_session(check_tree(tree, {}, base=folder).config, bus=observed(seen.append, bus))
    return folder / "out", folder / "recorded" / summary["recording"]["file"], received, seen


Session = tuple[Path, Path, list[Event], list[LoopView]]


def test_an_event_is_told_recorded_and_tabled_alike(session: Session) -> None:
    out, file, received, _ = session
    assert "contact" in {event.kind for event in received}
    reader = McapReader(file)
    recorded = [read(Event, m.value) for m in reader.messages() if m.topic == "/touch/event"]
    assert recorded == received
    assert reader.metadata["records"]["Event"] == "1"
    assert reader.metadata["units"]["Event.taken_ns"] == "ns"
    with (out / "events.csv").open(newline="") as text:
        table = list(csv.DictReader(text))
    assert [(row["kind"], row["finger"]) for row in table] == [(e.kind, e.finger) for e in received]
    assert [float(row["confidence"]) for row in table] == [e.confidence for e in received]
    assert all(event.began_ns <= event.t_ns <= event.taken_ns for event in received)


def test_a_replay_finds_the_same_events(session: Session) -> None:
    _, file, received, _ = session
    (stream,) = (s for s in replay_file(file).streams if s.stream == "/touch/event")
    assert (stream.recorded, stream.replayed, stream.differ) == (len(received), len(received), 0)


def test_a_display_says_the_newest_event_while_it_is_new(session: Session) -> None:
    *_, received, seen = session
    first = received[0]
    before = [view.newest_event for view in seen if view.t_ns < first.t_ns]
    assert set(before) <= {""}
    after = next(view for view in seen if view.t_ns >= first.taken_ns)
    assert after.newest_event.startswith("contact: index, 0.")
    assert "contact: index" in status_html(ViewState(after.t_ns, after))
    late = after._replace(t_ns=first.t_ns + 3_000_000_001)
    assert late.newest_event == ""


def test_events_are_looked_for_only_where_somebody_wants_them() -> None:
    shape: dict[str, Any] = {
        "mass": 6e4,
        "centroid_xy": (120.0, 100.0),
        "eda": 3000,
        "cci": 0.5,
        "peak": 30.0,
    }
    firm = Contact(finger="index", t_ns=0, in_contact=True, **shape)
    loop = TouchLoop({"index": TouchMaxima(cci_max=1.0, eda_max=3000.0)}, layout="x40")
    loop.update("index", firm)
    assert len(loop.found) == 0
    loop.find_events()
    kinds: set[str] = set()
    for n in range(1, 30):
        seen = firm if n > 5 else Contact(finger="index", t_ns=0, in_contact=False)
        loop.update("index", replace(seen, t_ns=n * 16_000_000))
        kinds |= {event.kind for event in loop.found}
    assert kinds == {"contact"}


def test_the_table_of_an_arm_is_made_from_its_turns() -> None:
    head = columns(ArmTurn)
    assert head[:5] == ("t_s", "state", "reason", "holds", "arm_x_m")
    assert head[-1] == "target_qw"
    requested: dict[str, Any] = dict.fromkeys(("clutch", "dead_man", "may_move", "cleared"), False)
    requested |= {"t_ns": 1_500_000_000, "poses": (), "stopped": "", "state": "holding", "holds": 2}
    requested |= {"velocity": (0.0,) * 6, "phase": "ready", "reason": "no pose came, 200 ms"}
    place, turn = (0.1, -0.2, 0.30000000000000004), (0.0, 0.0, 0.0, 1.0)
    known = ArmTurn(measured=(PoseNumbers(1, place, turn),), target=(), **requested)
    (row,) = csv.DictReader([",".join(head), *rows(known)])
    assert (row["t_s"], row["reason"], row["holds"]) == ("1.500000", "no pose came, 200 ms", "2")
    assert float(row["arm_z_m"]) == place[2]
    assert row["target_x_m"] == ""
    damaged = ArmTurn(measured=(PoseNumbers(1, (math.nan,), ()),), target=(*place, *turn), **requested)
    (row,) = csv.DictReader([",".join(head), *rows(damaged)])
    assert row["arm_x_m"] == ""
    assert float(row["target_qw"]) == 1.0
