"""Terminal and page show what was confirmed, and alerts: each state of a run is compared with its recording."""

from __future__ import annotations

import html
import io
import os
import re
import signal
import time
from collections.abc import Sequence
from itertools import cycle, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import pytest
from rich.console import Console

from hazards.bench import lab
from reference.parts import Running, observed
from reference.processes import begun_by, until
from reference.sessions import Recorded, read_recorded
from tega.config import check_tree
from tega.errors import DeviceUnavailableError, RecordingError
from tega.loop import rig
from tega.loop.snapshot import LoopView
from tega.recording.mcap_reader import McapReader
from tega.records import HandCommand, Intent, Joints, SentFrame, VestFrame
from tega.records.outputs import VestRecord
from tega.runtime.clock import PausableClock
from tega.ui.cli.report import echo_summary
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.state_html import status_html
from tega.ui.view.browser.vest import vest_svg
from tega.ui.view.state import ViewState
from tega.ui.view.terminal import render

pytestmark = pytest.mark.slow

ROWS = {"muscles", "hand", "vest"}
_R = TypeVar("_R", HandCommand, Joints, VestRecord, Intent)


class Shown(NamedTuple):
    """A moment as both displays drew it: rows by name, and the percents on the page's vest in the frame's order."""

    view: LoopView
    terminal: dict[str, str]
    page: dict[str, str]
    discs: list[int]


def displayed(view: LoopView) -> Shown:
    console = Console(file=io.StringIO(), width=80, color_system=None)
    console.print(render(view, title="test", rates_hz={}))
    assert isinstance(console.file, io.StringIO)
    lines = [line.strip("│").strip() for line in console.file.getvalue().splitlines()]
    assert len(lines) <= 24
    terminal = {line[:8].strip(): line[8:].strip() for line in lines if line[:8].strip() in ROWS}
    page = status_html(ViewState(view.t_ns, view))
    cells = re.findall(r"<tr><td[^>]*>(muscles|hand|vest)</td><td[^>]*><b>(.*?)</b>", page)
    discs = [int(text) for text in re.findall(r'pointer-events="none">(\d+)<', vest_svg(view.vest))]
    return Shown(view, terminal, {name: html.unescape(text) for name, text in cells}, discs)


def newest(records: Sequence[_R], t_ns: int) -> _R | None:
    return next((one for one in reversed(records) if one.t_ns <= t_ns), None)


def check(snapshot: Shown, recorded: Recorded) -> None:
    view, t_ns = snapshot.view, snapshot.view.t_ns
    assert snapshot.terminal == snapshot.page
    assert set(snapshot.page) == ROWS
    command = newest(recorded.of(HandCommand), t_ns)
    assert command is not None
    message = re.match(r"command (?:level (\d)|zero torque)", snapshot.page["hand"])
    assert message is not None, snapshot.page
    ended = view.state == "stopped"
    assert int(message[1] or 0) == (0 if ended else command.level)
    joints = newest(recorded.of(Joints), t_ns)
    if joints is not None and view.angles_rad is not None and not ended:
        bends = [sum(joints.angles_rad[4 * k + 1 : 4 * k + 4]) for k in range(4)]
        expected = " ".join(f"{bend:.2f}" for bend in bends)
        source = "reported" if "hand" in view.devices else "modelled"
        assert f"{source} bend {expected} rad" in snapshot.page["hand"]
    intent = newest(recorded.of(Intent), t_ns)
    if intent is not None and not ended:
        assert f"level {intent.level}: " in snapshot.page["muscles"]
        silent = t_ns - intent.t_ns > 400_000_000
        assert snapshot.page["muscles"].startswith("no data") == silent
    frames = recorded.of(SentFrame if "vest" in view.devices else VestFrame)
    frame = newest(frames, t_ns)
    assert frame is not None
    sent = [0] * 40 if ended else list(frame.intensities)
    assert snapshot.discs == [value for value in sent if value]
    text = f"up to {max(sent)} %" if any(sent) else "all motors at 0 %"
    assert text in snapshot.page["vest"]


def compared(moments: list[Shown], folder: Path) -> dict[str, list[Shown]]:
    recorded = read_recorded(next(folder.rglob("*.mcap")))
    states: dict[str, list[Shown]] = {}
    for snapshot in moments:
        states.setdefault(snapshot.view.state, []).append(snapshot)
        if snapshot.view.intent is not None and snapshot.view.vest is not None:
            check(snapshot, recorded)
    return states


def bench(folder: Path, **tables: Any) -> Any:
    tables["recording"] = {"dir": str(folder / "recorded"), "stop_free_mib": 0.0}
    return lab(folder, emg=True, hand=True, vest=True, fingers=("thumb",), camera_hz=30.0, **tables)


def test_armed_active_held_idle_and_stopped_show_what_the_recording_has(tmp_path: Path) -> None:
    with bench(tmp_path, safety={"hold_ms": 1000.0}) as made:
        made.may_go = False
        moments: list[Shown] = []
        with made.session(observe=lambda view: moments.append(displayed(view))):
            made.until(lambda: made.state == "armed")
            time.sleep(1.0)
            made.may_go = True
            made.until(lambda: made.state == "active")
            time.sleep(1.5)
            made.emg.say("unplug")
            made.until(lambda: made.state == "hold")
            made.until(lambda: made.state == "idle")
            time.sleep(1.0)
    states = compared(moments, tmp_path)
    assert set(states) == {"armed", "active", "hold", "idle", "stopped"}
    # The muscles squeeze while the run waits, and after the loss the last level stands: the hand is open all the same.
    waiting = states["armed"][-1]
    assert waiting.view.intent is not None
    assert waiting.page["hand"].startswith("command level 1: open")
    assert states["active"][-1].page["hand"].startswith("command level 5: tight")
    assert states["idle"][-1].page["hand"].startswith("command level 1: open")
    assert states["idle"][-1].page["muscles"].startswith("no data for ")
    end = states["stopped"][-1]
    assert end.page["hand"].startswith("command zero torque")
    assert end.page["vest"].startswith("sent: all motors at 0 %")
    assert end.discs == []


@pytest.mark.raises("hand's link")
def test_a_lost_hand_is_not_shown_as_steered(tmp_path: Path) -> None:
    with bench(tmp_path, safety={"hold_ms": 500.0}) as made:
        moments: list[Shown] = []
        made.tree["hand"]["options"] |= {"silent_after_ms": 200.0, "reconnects": 5}
        lost = pytest.raises(DeviceUnavailableError)
        with made.session(observe=lambda view: moments.append(displayed(view)), ends=lost):
            made.until(lambda: made.state == "active")
            time.sleep(1.0)
            made.hand.say("silence")
            made.until(lambda: made.state == "idle")  # so that it opens once it is back
            made.hand.say("clear")
            made.until(lambda: made.state == "active")
            made.hand.say("silence")
            made.until(lambda: made.state == "stopped")
    states = compared(moments, tmp_path)
    assert all("no angles reported" in one.page["hand"] for one in states["hold"])
    assert "hand: silent" in states["hold"][-1].view.reason
    joints = read_recorded(next(tmp_path.rglob("*.mcap"))).of(Joints)
    assert max(b.t_ns - a.t_ns for a, b in pairwise(joints)) > 500_000_000
    assert states["stopped"][-1].page["hand"].startswith("command zero torque")
    assert states["stopped"][-1].view.reason


def test_a_paused_run_shows_its_last_moment_and_go_cannot_be_pressed(tmp_path: Path) -> None:
    source = {"driver": "synthetic-touch", "options": {"seed": 1, "duration_s": 4.0}}
    muscles = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": 4.0}}
    recording = {"dir": str(tmp_path / "recorded"), "stop_free_mib": 0.0}
    tree = {"session": {"pace": "real"}, "tactile": {"thumb": source}, "emg": muscles, "recording": recording}
    config = check_tree(tree, {}, base=tmp_path).config
    controls = Controls(can_pause=True, can_mute=True, can_go=True)
    moments: list[Shown] = []
    clock = PausableClock(lambda: controls.paused)
    with BrowserView(port=0, controls=controls) as view:
        run = Running(config, observed(lambda loop: moments.append(displayed(loop))), clock=clock)
        view.watch(run.bus)
        run.thread.start()
        until(lambda: len(moments) > 30)
        assert view.page.inputs["go"].disabled  # the run steers already
        controls.paused = True
        until(lambda: "PAUSED" in view.page.run_state.content)
        time.sleep(0.5)
        n_displayed, last = len(moments), moments[-1]
        time.sleep(0.5)
        assert len(moments) == n_displayed
        until(lambda: f"<b>{last.page['hand']}</b>" in view.page.status.content)
        controls.paused = False
        run.thread.join(30.0)
        until(lambda: "STOPPED" in view.page.run_state.content)
        until(lambda: "tega-ended" in view.page._vest.content)
        assert view.page.inputs["haptics"].disabled
        assert view.page.inputs["go"].disabled
    assert not run.thread.is_alive()
    recorded = read_recorded(next((tmp_path / "recorded").rglob("*.mcap")))
    check(last, recorded)
    check(moments[-1], recorded)
    assert last.page["vest"].startswith("computed, no vest connected")


def recorded(summary: dict[str, Any], folder: Path) -> list[str]:
    file = folder / str(summary["recording"]["file"])
    return [one.value.said for one in McapReader(file).messages() if one.schema == "tega.Alert"]


@pytest.mark.raises("clock")
def test_a_clock_that_is_set_is_an_alert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ahead_ns = [0]
    clock = SimpleNamespace(monotonic_ns=time.monotonic_ns, time_ns=lambda: time.time_ns() + ahead_ns[0])
    monkeypatch.setattr(rig, "time", clock)
    with lab(tmp_path, emg=True, recording={"dir": str(tmp_path / "recorded")}) as made:
        with made.session():
            made.until(lambda: made.state == "active")
            ahead_ns[0] = 90 * 10**9
            made.until(lambda: "the time of day jumped by +90.0 s" in made.said())
        alerts = recorded(made.summary, tmp_path / "recorded")
    assert any("the time of day jumped by +90.0 s" in text for text in alerts)


@pytest.mark.raises("latency")
def test_a_latency_over_its_budget_is_an_alert(tmp_path: Path) -> None:
    recording = {"dir": str(tmp_path / "recorded")}
    with lab(tmp_path, emg=True, vest=True, fingers=("thumb",), recording=recording) as made:
        made.tree["safety"] |= {"latency_budget_ms": 0.001}
        presses = cycle(["press 0", "press 0.7"])
        with made.session():
            made.until(lambda: made.state == "active")

            def reported() -> bool:
                made.sensors["thumb"].say(next(presses))
                time.sleep(0.4)
                return "ms are allowed" in made.said()

            made.until(reported)
        assert any("ms are allowed" in text for text in recorded(made.summary, tmp_path / "recorded"))


@pytest.mark.raises("recording")
def test_a_recorder_that_is_killed_is_an_alert(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, recording={"dir": str(tmp_path / "recorded")}) as made, made.session():
        made.until(lambda: made.state == "active")
        (pid,) = begun_by(os.getpid(), "tega.recording.recorder_program")
        os.kill(pid, signal.SIGKILL)
        made.until(lambda: "recorder's process ended" in made.said())
    # The file ended before it; the summary has it.
    assert any("recorder's process ended" in text for text in made.summary["safety"]["alerts"])
    with pytest.raises(RecordingError, match=r"recording stopped after .* s: "):
        echo_summary(made.summary, wall_s=1.0, as_json=False)
