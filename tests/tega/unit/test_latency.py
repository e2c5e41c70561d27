"""The latency trace on times that are made up, and on a run with emulated devices."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reference.vest_bench import HandedOver
from tega.config import check_tree
from tega.config.motor_onset import MotorOnset
from tega.loop.inbox.histogram import Histogram
from tega.loop.latency import INTENT_STAGES, TOUCH_STAGES, LatencyTrace
from tega.loop.session import run_session
from tega.records import Latency
from tega.records.bus import Bus
from tega_emulators.lab import PRESSED, emulated_lab, pressing

MS = 1_000_000


def test_a_spread_is_right_within_two_percent() -> None:
    rng = random.Random(4)
    taken = [round(MS * rng.lognormvariate(0, 1)) for _ in range(5000)]
    spread = Histogram()
    for ns in taken:
        spread.add(ns)
    for share in (0.5, 0.95, 0.99):
        assert spread.at(share) == pytest.approx(np.quantile(taken, share, method="inverted_cdf"), rel=0.021)
    assert spread.at(1.0) == spread.worst_ns == max(taken)
    assert Histogram().summary_ms() == {"n": 0, "worst": 0.0}
    spread = Histogram()
    for k in range(99):
        spread.add(k * MS)
    assert spread.summary_ms() == {"n": 99, "worst": 98.0}
    spread.add(99 * MS)
    assert set(spread.summary_ms()) == {"n", "p50", "p95", "p99", "worst"}


class Made:
    """A trace that began when the monotonic clock showed 1000 ms, with a vest that tells of its hand-overs."""

    def __init__(self, **how: Any) -> None:
        self.now_ns, self.link, self.reported = 0, HandedOver(), list[Latency]()
        bus = Bus()
        bus.subscribe(Latency, self.reported.append)
        given: dict[str, Any] = {"budget_ms": 5.0, "vests": [self.link], "start_ns": 1000 * MS, "bus": bus}
        self.trace = LatencyTrace(now_ns=lambda: self.now_ns, **(given | how))

    def item(
        self, name: str, captured_ms: int, received_ms: int, done_ms: int, *, taken: bool = True
    ) -> None:
        """Let a picture or block be captured, received and measured, and the loop take it in."""
        self.now_ns = done_ms * MS
        self.trace.source(name)(captured_ms * MS, (1000 + received_ms) * MS)
        if taken:
            self.trace.taken(name, captured_ms * MS)

    def vest(self, tick_ms: int, made_ms: int | None = None, *, changed: bool = True) -> None:
        made_ns = (tick_ms if made_ms is None else made_ms) * MS
        self.trace.vest(tick_ms * MS, tick_ms * MS, made_ns, changed=changed)

    def touch_for_a_while(self, n: int, took_ms: Callable[[int], int]) -> None:
        """Let so many pictures, 33 ms apart, be handed over so long after their frame was made."""
        for k in range(n):
            self.item("thumb", 33 * k, 33 * k, 33 * k + 1)
            self.now_ns = (33 * k + 2) * MS
            self.trace.vest(33 * k * MS, self.now_ns, self.now_ns, changed=True)
            self.link.handed.append((33 * k * MS, 0, 1000 * MS + self.now_ns + took_ms(k) * MS))


def test_a_vest_frame_knows_its_camera_frames() -> None:
    made = Made()
    for name, captured, received, done in (
        ("thumb", 10, 12, 13),
        ("index", 11, 14, 16),
        ("thumb", 26, 28, 30),
    ):
        made.item(name, captured, received, done, taken=False)
    made.trace.taken("thumb", 10 * MS)
    made.trace.taken("index", 11 * MS)
    made.trace.taken("thumb", 26 * MS)  # newer than the first one, which is never felt
    made.vest(33, 34)
    # A second vest frame of the same pictures, before the first was handed over.
    made.vest(66, 67)
    made.link.handed = [(33 * MS, 0, 1037 * MS), (66 * MS, 0, 1069 * MS)]
    made.vest(99)
    stamps = {frame.source: tuple(ns // MS for ns in frame.stamps_ns) for frame in made.reported}
    assert stamps == {"thumb": (26, 28, 30, 33, 34, 34, 37), "index": (11, 14, 16, 33, 34, 34, 37)}
    assert len(made.reported) == 2
    found = made.trace.summary()["touch"]
    assert {name: found[name]["worst"] for name in ("own", "in-hand", "whole")} == {
        "own": 6.0,
        "in-hand": 23.0,
        "whole": 26.0,
    }
    assert found["wait"]["n"] == 2


def test_what_the_vest_shows_already_does_not_count() -> None:
    made = Made()
    made.item("thumb", 0, 1, 2)
    made.vest(33, changed=False)
    made.vest(66)
    made.link.handed = [(66 * MS, 0, 1067 * MS)]
    made.vest(99, changed=False)
    assert made.reported == []


def test_beyond_the_budget_it_names_the_stage() -> None:
    made = Made(budget_ms=4.0)
    made.touch_for_a_while(200, lambda _k: 5)
    assert "7.1 ms" in made.trace.warning or "7.0 ms" in made.trace.warning
    assert "4 ms are allowed; most in 'hand-over'" in made.trace.warning
    assert made.trace.line == "camera to vest 7 ms, p99 7 (n 186) (ours 7.0, p99 7.0)"


def test_a_measured_motor_adds_its_onset_to_the_line() -> None:
    made = Made(budget_ms=50.0, motor=MotorOnset(60.0, "vest", (0,), "2026-11-21", 8.0))
    made.touch_for_a_while(150, lambda k: 5 + 4 * (k % 2))
    assert made.trace.line.startswith("camera to vest 7 ms, p99 11 (n 1")
    assert made.trace.line.endswith("(ours 7.0, p99 11.0), to the skin 67")


def test_a_joint_that_moves_late_is_named_with_the_number_of_motions() -> None:
    moves = list[tuple[int, ...]]()
    joints: Any = SimpleNamespace(n_unmoved=0, check=lambda *_given: moves.pop() if moves else None)
    made = Made(budget_ms=4.0, joint_budget_ms=200.0, joints=joints)
    for k, late_ms in enumerate((150, 190, 420)):
        at = k * 1000
        moves.append(tuple(ms * MS for ms in (at, at + 1, at + 2, at + 3, at + late_ms)))
        made.now_ns = (at + 500) * MS
        made.trace.commanded(3.0)
    assert made.trace.line == ""
    made.vest(5_001, changed=False)
    assert (
        "muscle to joint takes 420 ms (worst of 3), 200 ms are allowed; most in 'joint'" in made.trace.warning
    )
    assert made.trace.line == "muscle to joint 420 ms at most (n 3)"
    made.vest(10_100, changed=False)
    assert made.trace.warning == ""


def test_the_hand_s_own_clock_is_not_ours() -> None:
    answers: list[tuple[int, int]] = []
    made = Made(answered_ns=lambda since_ns: next((a for a in answers if a[1] >= since_ns), None))
    for at, answer in ((10, (1016, 1017)), (110, (1111, 1115))):
        made.item("emg", at, at, at + 1)
        made.now_ns = (at + 3) * MS
        made.trace.commanded(1)
        answers.append((answer[0] * MS, answer[1] * MS))
        made.now_ns = (at + 9) * MS
        made.trace.commanded(1)
    names = ("sample", "levels", "wait", "report", "hand-over", "own", "whole")
    stages = [tuple(block.stages_ns()[name] / MS for name in names) for block in made.reported]
    # The first is told at 13 ms, and the hand reports at 16. The second is told at 113, after a report at 111.
    assert stages == [(0, 1, 2, 3, 1, 2, 7), (0, 1, 2, 0, 2, 3, 5)]


def test_a_recording_of_before_reports_were_told_apart_is_read() -> None:
    old = Latency(path="intent", source="emg", stamps_ns=(0, 1, 3, 6, 10))
    message = {"sample": 1, "levels": 2, "wait": 3, "report": 0, "hand-over": 4, "own": 6, "whole": 10}
    assert old.stages_ns() == message


def test_memory_stays_the_same_however_long_it_runs() -> None:
    made = Made()
    for k in range(3000):
        made.item("thumb", k, k, k, taken=False)  # nobody takes these in
        made.vest(k)
    assert len(made.trace._coming["thumb"]) < 100
    assert len(made.trace._ticks) < 100


@pytest.mark.slow
def test_a_run_traces_both_ways(tmp_path: Path) -> None:
    fingers = ("thumb",)
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True, vest=True, fingers=fingers, touch=PRESSED) as lab:
        lab.tree["session"] = {"duration_s": 4.0}
        with pressing(lab):
            summary: dict[str, Any] = run_session(check_tree(lab.tree, {}, base=tmp_path).config)
    for path, stages in summary["latency_ms"].items():
        assert stages["whole"]["n"] > 5, path
        parts = [s for name, s in stages.items() if name not in {"own", "in-hand", "whole"}]
        assert all(("p99" in s) == (s["n"] >= 100) for s in parts)
        many = [s for s in parts if "p99" in s]
        assert all(0 <= s["p50"] <= s["p95"] <= s["p99"] <= s["worst"] for s in many)
        assert stages["own"]["worst"] <= stages["whole"]["worst"]
    assert {"touch", "intent"} <= set(summary["latency_ms"]) <= {"touch", "intent", "motion"}


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["live", "paper"])
def test_bench_loop_tells_every_stage(preset: str) -> None:
    words = [
        sys.executable,
        "-m",
        "tega.ui.cli",
        "bench",
        "loop",
        "--seconds",
        "3",
        "--preset",
        preset,
        "--json",
    ]
    message = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    assert message["preset"] == preset
    assert set(message["latency_ms"]["touch"]) == set(TOUCH_STAGES)
    assert set(message["latency_ms"]["intent"]) == set(INTENT_STAGES)
    assert message["frames_hz"] > 0
    assert message["cpu_cores"] > 0
