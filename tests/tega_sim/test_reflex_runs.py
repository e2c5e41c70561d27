"""A run with a reflex: what the hand is told, what is recorded and shown, and the recording computed again."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from reference.hand import stuck_hand
from reference.scripted import MS, Sink, touching
from reference.wired import wired_loop
from tega.config import FINGERS, ReflexSection, SessionConfig, load_config
from tega.errors import ConfigError
from tega.hand import HandController
from tega.hand.link import HandLink
from tega.loop.inbox.stream import PulledStream
from tega.loop.reflex import ReflexArc, open_reflex
from tega.loop.snapshot import LoopView, Snapshot
from tega.recording.replay.feed import Newest
from tega.recording.replay.inbox import RecordedGuard, recorded_arc
from tega.recording.replay.recompute import repeat_exchanges
from tega.records import (
    Button,
    Contact,
    HandCommand,
    HandExchange,
    Imposed,
    Intent,
    NamedValue,
    ReflexGrip,
    bus_frames,
)
from tega.records.bus import Bus


def slipping(share: float, t_ns: int = 0) -> Contact:
    return msgspec.structs.replace(touching(50, t_ns=t_ns), more=(NamedValue("incipient", share),))


class Ran:
    def __init__(self, reflex: ReflexSection, *, presses: int = 0, page: float | None = None) -> None:
        sets = [f"stages.reflex.{name}={getattr(reflex, name)}" for name in reflex.__struct_fields__[2:]]
        named = [] if reflex.name is None else [f"stages.reflex.name={reflex.name}", *sets]
        self.config: SessionConfig = load_config(None, environ={}, sets=named).config
        bus, self.views = Bus(), list[LoopView]()
        self.reported, self.commands = list[ReflexGrip](), list[HandCommand]()
        bus.subscribe(ReflexGrip, self.reported.append, vital=True)
        bus.subscribe(HandCommand, self.commands.append, vital=True)
        bus.subscribe(Snapshot, lambda snapshot: self.views.append(snapshot.view), vital=True)
        thumb = [slipping(1.0 if 10 <= k < 20 else 0.0, k * 20 * MS) for k in range(100)]
        self.arc: ReflexArc | None = open_reflex(
            self.config, bus, ["thumb"], active=lambda: True, hand=None, authority=lambda: page
        )
        for n in range(presses):
            bus.publish(Button(seat="reflex", t_ns=0, seq=n, button="1", pressed=True))
        wired_loop(
            contacts={"thumb": PulledStream(thumb)},
            levels=PulledStream([Intent(t_ns=0, channels=(3,), level=3)], end_ns=2000 * MS),
            hands=[Sink()],
            bus=bus,
            reflex=self.arc,
        ).run()


FULL = ReflexSection(name="grip", authority=1.0)


def test_a_slip_firms_the_hand_which_is_recorded_and_shown() -> None:
    run = Ran(FULL)
    assert run.arc is not None
    most = max(one.added for one in run.reported)
    assert most == pytest.approx(0.5)
    assert run.arc.most_added == most
    firm = [one for one in run.commands if one.closure is not None]
    first_ns, last_ns = firm[0].t_ns, firm[-1].t_ns
    assert 200 * MS <= first_ns <= 206 * MS
    # Half a second after the slip, and then half a level a second.
    assert 1.85e9 < last_ns < 1.95e9
    by_tick = {one.t_ns: one for one in run.reported}
    for command in run.commands[:-1]:
        reported = by_tick[command.t_ns]
        closure = None if reported.added == 0 else (reported.own + reported.added - 1) / 4
        assert command.closure == closure
    assert any(view.reflex.startswith("+0.50 levels added, authority 100% (slip") for view in run.views)
    assert run.views[0].reflex == "authority 100%"


def test_without_a_reflex_or_its_authority_the_hand_is_told_the_same_bits() -> None:
    without = Ran(ReflexSection())
    assert without.arc is None
    assert without.views[-1].reflex == ""
    idle = Ran(ReflexSection(name="grip"))
    assert idle.reported == []
    assert idle.commands == without.commands
    assert Ran(FULL).commands != without.commands


def test_button_and_page_set_the_authority() -> None:
    assert Ran(FULL, presses=1).reported == []
    assert max(one.added for one in Ran(FULL, presses=2).reported) == pytest.approx(0.5)
    # The page said nothing new.
    assert max(one.added for one in Ran(FULL, page=0.4).reported) == pytest.approx(0.5)
    config = load_config(None, environ={}, sets=["stages.reflex.name=grip"]).config
    wanted = 0.0
    arc = open_reflex(config, Bus(), ["thumb"], active=lambda: True, hand=None, authority=lambda: wanted)
    assert arc is not None
    for wanted in (0.0, 0.4):
        assert arc._snapshot(0).authority == wanted


def test_a_recorded_run_is_computed_again_with_what_was_imposed() -> None:
    run = Ran(FULL)
    rows = [one for one in run.reported if one.t_ns < 1_000 * MS]
    grips, imposed = Newest[ReflexGrip](), Newest[Imposed]()
    grips.rows.extend(rows)
    imposed.rows.extend([Imposed(t_ns=600 * MS, level=4), Imposed(t_ns=800 * MS, level=0)])
    again: list[ReflexGrip] = []
    now = 0
    bus = Bus()
    bus.subscribe(ReflexGrip, again.append, vital=True)
    arc = recorded_arc(run.config, ["thumb"], lambda _kind: grips, bus)
    guard = RecordedGuard(imposed, lambda: now)
    assert arc is not None
    for row in rows:
        now = row.t_ns
        share = 1.0 if 200 * MS <= now < 400 * MS else 0.0
        arc.step(now, guard.level(3.0), lambda s=share: {"thumb": slipping(s)})  # type: ignore[misc]
    same = [one for one in rows if one.t_ns < 600 * MS]
    assert again[: len(same)] == same
    assert {one.own for one in again if 600 * MS <= one.t_ns < 800 * MS} == {4.0}
    assert Imposed.topic != ReflexGrip.topic


def test_what_was_said_with_a_real_hand_is_computed_again_with_what_was_added() -> None:
    link, exchanges = HandLink(HandController()), list[HandExchange]()
    for k in range(400):
        frames, t_ns = stuck_hand(k), k * 3 * MS
        added = 0.5 if 200 <= k < 300 else 0.0
        sent = bus_frames(link.exchange(frames, t_ns, 3.0, added))
        told: dict[str, Any] = {"action": "exchange", "added": added}
        exchanges.append(HandExchange(t_ns=t_ns, level=3, received=bus_frames(frames), sent=sent, **told))
    assert sum(len(one.sent) >= 4 for one in exchanges[200:]) > 150
    tree = {"hand": {"options": {"interface": "virtual", "channel": "x", "silent_after_ms": 30.0}}}

    def differ(text: list[HandExchange]) -> int:
        head: Any = SimpleNamespace(tree=tree, files={})
        recorded, bus, again = Bus(), Bus(), list[HandExchange]()
        bus.subscribe(HandExchange, again.append, vital=True)
        repeat_exchanges(recorded, head, bus)
        for one in text:
            recorded.publish(one)
        return sum(one != other for one, other in zip(text, again, strict=True))

    assert differ(exchanges) == 0
    assert differ([msgspec.structs.replace(one, added=0.0) for one in exchanges]) > 50


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (["stages.reflex.authority=0.5"], "stages.reflex.name is not set"),
        (["stages.reflex.name=none"], "no reflex is called 'none'"),
        (["stages.reflex.name=grip", "stages.reflex.authority=1.5"], "1.0"),
        (["stages.reflex.name=grip", "stages.reflex.most_levels=3"], "most_levels"),
        (["stages.reflex.name=grip", "stages.reflex.options.incipient_from=1"], "incipient_from"),
    ],
)
def test_settings_that_do_not_fit_are_refused(sets: list[str], text: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_config(None, environ={}, sets=sets)
    assert text in str(refused.value)


@pytest.mark.slow
def test_a_recorded_lift_with_a_reflex_is_computed_again_bit_for_bit(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    from tega.recording.replay import replay_file
    from tega_sim.streams import LiftRecorder
    from tega_sim.trial import TrialPlan, run_trial

    settings = ("stages.reflex.name=grip", "stages.reflex.authority=1", "stages.reflex.options.keep_s=1")
    plan = TrialPlan(object="bottle", condition="haptic-reflex", seed=3, settings=settings, friction=0.45)
    recorder = LiftRecorder(tmp_path / "rec", real_time=False)
    run_trial(plan, recorder=recorder, practised=False)
    (file,) = (tmp_path / "rec").rglob("*.mcap")
    found = replay_file(file)
    assert found.same
    (reflex,) = [stream for stream in found.streams if stream.stream == ReflexGrip.topic]
    assert reflex.recorded == reflex.replayed > 1000
    off = replay_file(file, sets=["stages.reflex.authority=0"])
    assert "stages.reflex.authority: 1.0 -> 0.0" in off.changed


def trial_arc(config: SessionConfig, reports: Any, **sensed: Any) -> Any:
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    from tega_sim.true_touch import trial_reflex

    return trial_reflex(config, reports, Bus(), **sensed)


def test_a_reflex_without_authority_acts_at_full_authority_in_the_arms_that_have_one_alone() -> None:
    named = ["stages.reflex.name=grip", "stages.reflex.most_levels=1"]
    sensed = {"closure": lambda: 2.0, "slip_mm_s": lambda: 10.0, "forces_n": lambda: (1.0,) * 4}

    def reported(reports: Any, authority: float) -> Any:
        config = load_config(None, environ={}, sets=[*named, f"stages.reflex.authority={authority}"]).config
        arc = trial_arc(config, reports, **sensed)
        return 3.0 + [arc.step(n * 3 * MS, 3.0, lambda: {"thumb": slipping(1.0)}) for n in range(200)][-1]

    assert reported("none", 0.0) == 3.0
    assert reported("none", 0.5) == pytest.approx(3.5)
    assert reported("touch", 0.0) == reported("true slips", 0.0) == pytest.approx(4.0)
    assert reported("touch", 0.5) == reported("true slips", 0.5) == pytest.approx(3.5)


def test_an_arm_with_a_reflex_has_it_at_full_authority() -> None:
    config = load_config(None, environ={}).config
    slip_mm_s, forces_n = 0.0, (0.0,) * 4
    sensed = {
        "closure": lambda: 1.0 if max(forces_n) == 0 else 2.5,
        "slip_mm_s": lambda: slip_mm_s,
        "forces_n": lambda: forces_n,
    }
    none, true, touch = (trial_arc(config, reports, **sensed) for reports in ("none", "true slips", "touch"))
    assert none is None
    n = 0

    def reported() -> float:
        nonlocal n
        for _ in range(200):
            n += 1
            level = 3.0 + true.step(n * 3 * MS, 3.0, dict)
            assert touch.step(n * 3 * MS, 3.0, dict) == 0.0, "nothing touches"
        return float(level)

    slip_mm_s = 10.0
    assert reported() == 3.0, "no finger bears a force"
    slip_mm_s, forces_n = 0.0, (0.0, 1.0, 0.0, 0.0)
    assert reported() == 3.0
    slip_mm_s = 10.0
    # Closing onto the object is no give of it.
    assert reported() == pytest.approx(3.5)
    assert set(FINGERS) == set(true.reflex._fingers)
