"""How long each guard takes, as the settings come, on clocks that the tests move: the hazard table's "within"."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reference.scripted import MS, touching
from tega.config import ReflexSection
from tega.config.calibration import TouchMaxima
from tega.devices.input.pedal import Pedal, PedalOptions
from tega.loop.hand import HAND_TICK_NS
from tega.loop.inbox.sources import SourceReport
from tega.loop.reflex import ReflexArc, ReflexInputs
from tega.loop.touch import TouchLoop
from tega.records import Contact, NamedValue
from tega.safety.guard import Guard, Watched
from tega.safety.states import SafetySection
from tega.stages.base import ReflexSetup
from tega.stages.grip_reflex import GripReflex, GripReflexOptions
from tega_link.clock import Offset, StampGate
from tega_link.messages import Stamped
from tega_link.settings import NetSection

TICK_MS = HAND_TICK_NS / MS


class _Run:
    """A guard in a loop of hand's ticks, with EMG at ten blocks a second and a finger at 60 pictures."""

    def __init__(self, **settings: Any) -> None:
        self.guard = Guard(
            SafetySection(**settings),
            streams=[
                Watched("emg", "emg", 10.0, SourceReport()),
                Watched("thumb", "tactile", 60.0, SourceReport()),
            ],
            needs={"link": lambda: self.link},
        )
        self.link = self.released = ""
        self.late_ns = 0
        self.unvoted: float | None = None
        self.silent_from_ms = {"emg": np.inf, "thumb": np.inf}
        self.t_ms = 0.0
        self.until(lambda: self.guard.state == "active")

    def until(self, subject: Callable[[], bool]) -> float:
        """Tick until something is so; return for how long, milliseconds."""
        began_ms = self.t_ms
        while not subject():
            assert self.t_ms < began_ms + 10_000
            self.t_ms += TICK_MS
            t_ns = round(self.t_ms * MS)
            stamps, counts = {}, {}
            for name, period_ms in (("emg", 100.0), ("thumb", 1000 / 60)):
                n = int(min(self.t_ms, self.silent_from_ms[name]) / period_ms)
                if n:
                    stamps[name], counts[name] = round(n * period_ms * MS), n
            if self.guard.due(t_ns, self.late_ns):
                seen: dict[str, Any] = {"late_ns": self.late_ns, "stamps": stamps, "counts": counts}
                self.guard.check(t_ns, **seen, unvoted=self.unvoted, released=self.released)
        return self.t_ms - began_ms

    def held(self) -> float:
        """Return after how long it holds, milliseconds."""
        return self.until(lambda: self.guard.state == "hold")


def test_emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later() -> None:
    run = _Run()
    run.until(lambda: run.t_ms % 100 < TICK_MS)  # a block has just come
    run.silent_from_ms["emg"] = run.t_ms
    assert 250 - TICK_MS < run.held() <= 260 + TICK_MS
    assert 2000 <= run.until(lambda: run.guard.state == "idle") <= 2010 + TICK_MS


def test_a_lost_picture_holds_within_120_ms_where_the_settings_say_so() -> None:
    run = _Run(tactile_lost="hold")
    run.silent_from_ms["thumb"] = run.t_ms
    assert 80 < run.held() <= 120 + TICK_MS
    reported = _Run()
    reported.silent_from_ms["thumb"] = reported.t_ms
    assert reported.until(lambda: "thumb" in reported.guard.alerts) <= 120 + TICK_MS
    assert reported.guard.state == "active"


def test_emg_without_a_vote_a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look() -> None:
    unvoted, released, late, link = _Run(), _Run(), _Run(), _Run()
    unvoted.unvoted = 3.0
    assert unvoted.held() <= 10 + TICK_MS
    released.released = "dead-man: released"
    link.link = "link: no command"
    late.late_ns = 101 * MS
    assert released.held() <= 10 + TICK_MS
    assert link.held() <= 10 + TICK_MS
    assert late.held() <= TICK_MS  # is not waited for
    punctual = _Run()
    punctual.late_ns = 99 * MS
    punctual.until(lambda t_ms=punctual.t_ms: punctual.t_ms > t_ms + 500)  # type: ignore[misc]
    assert punctual.guard.state == "active"


def test_what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold() -> None:
    run, now = _Run(emg_lost_ms=160), ReflexInputs(1.0, True, None)
    bounds = ReflexSection(name="grip", authority=1.0, most_levels=1.0)
    arc = ReflexArc(
        GripReflex(ReflexSetup(("thumb",)), GripReflexOptions()), bounds, snapshot=lambda _t_ns: now
    )
    slips = Contact(finger="thumb", t_ns=0, in_contact=True, more=(NamedValue("incipient", 1.0),))

    def ticked(contacts: dict[str, Contact]) -> float:
        run.t_ms += TICK_MS
        return 3.0 + arc.step(round(run.t_ms * MS), 3.0, lambda: contacts)

    while arc.added < 1.0:
        ticked({"thumb": slips})
    run.silent_from_ms["emg"] = run.t_ms
    held_ms = run.until(lambda: run.guard.state == "hold")
    assert held_ms <= 260 + TICK_MS
    now, began_ms = ReflexInputs(1.0, run.guard.state == "active", None), run.t_ms
    while ticked({"thumb": slips}) > 3.0:
        assert run.t_ms < began_ms + 1000
    assert run.t_ms - began_ms <= 200 + TICK_MS
    # Its fingers lost, in an active run: as slowly as a slip is forgotten.
    now = ReflexInputs(1.0, True, None)
    while arc.added < 1.0:
        ticked({"thumb": slips})
    began_ms = run.t_ms
    while ticked({}) > 3.0:
        assert run.t_ms < began_ms + 10_000
    assert run.t_ms - began_ms == pytest.approx(2000, abs=2 * TICK_MS)


def test_a_stale_finger_is_silent_after_100_ms_and_a_refresh() -> None:
    loop = TouchLoop({"thumb": TouchMaxima(cci_max=0.01, eda_max=10.0)}, layout="x40")
    loop.update("thumb", touching(50))
    assert loop.frame(100 * MS).intensities.any()
    refreshes_ms = np.arange(1, 20) * 1000 / 30
    silent_ms = next(t for t in refreshes_ms if not loop.frame(round(t * MS)).intensities.any())
    assert silent_ms <= 100 + 1000 / 30 + 1


def test_a_dead_man_that_says_nothing_is_let_go_after_its_time() -> None:
    pedal = Pedal(PedalOptions(report="joystick", vendor_id=0x05F3, button_byte=3, silent_after_ms=100.0))
    pedal._there, pedal._received_ns = True, 0
    list(pedal._buttons.take(-1000 * MS, {"1"}))
    list(pedal._buttons.settle(0))
    assert pedal._buttons.held
    pedal._pass_time(100 * MS)
    assert pedal._buttons.held
    pedal._pass_time(101 * MS)
    assert not pedal._buttons.held


def test_a_message_older_than_100_ms_is_not_used() -> None:
    ttl_ns = round(NetSection(station="robot").ttl_ms * MS)
    assert ttl_ns == 100 * MS
    for age_ms, refused in ((80, ""), (100, ""), (101, "old")):
        gate = StampGate(ttl_ns=ttl_ns)
        gate.begin(1)
        stamp = Stamped(session=1, sequence=0, sent_ns=0)
        assert gate.refusal(stamp, age_ms * MS, Offset(0, 0)) == refused


def test_a_page_without_news_says_so_after_a_second_and_a_half() -> None:
    server = pytest.importorskip("tega.ui.view.browser.server")
    reported_s: list[float] = []
    page = SimpleNamespace(paint_state=lambda _loop, *, age_s, **_words: reported_s.append(age_s))
    newest = 10.0, SimpleNamespace(loop=None)
    view = SimpleNamespace(_newest=newest, _reported_age_s=0.0, page=page, problem="")
    for tenth in range(31):
        server.BrowserView._report_age(view, 10.0 + tenth / 10)
    assert reported_s[0] == pytest.approx(1.5, abs=0.11)
