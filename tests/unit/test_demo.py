"""The demo: made-up input through the real loop, its screen and its picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from tega.cli.main import main
from tega.devices.synthetic import (
    SyntheticEmg,
    SyntheticEmgOptions,
    SyntheticTouch,
    SyntheticTouchOptions,
    effort_at,
)
from tega.haptics import vest_frame
from tega.sim.gel import Gel, ball
from tega.sim.muscle import emg_from_effort
from tega.tactile import ContactMetrics, read_contact
from tega.teleop.loop import LoopView
from tega.teleop.touch import Felt
from tega.view.terminal import TerminalView, render


def run_demo(folder: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    with pytest.raises(SystemExit) as done:
        main(["demo", "--fast", "--seconds", "3", "--json", "--out", str(folder), *words])
    captured = capsys.readouterr()
    assert done.value.code == 0, captured.err
    summary: dict[str, object] = json.loads(captured.out)
    return summary


def test_the_demo_grasps_is_felt_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra tega[view]")
    summary = run_demo(tmp_path / "demo", capsys)
    assert summary["ended"] == "complete"
    assert (tmp_path / "demo" / "demo.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    levels = [line.split(",")[-1] for line in (tmp_path / "demo" / "levels.csv").read_text().splitlines()[1:]]
    assert {"1", "5"} <= set(levels)
    contacts = (tmp_path / "demo" / "contacts.csv").read_text()
    for finger in ("thumb", "index", "middle", "ring"):
        assert any(f",{finger}," in line and ",1," in line for line in contacts.splitlines())


def test_two_demos_of_one_seed_are_the_same_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra tega[view]")
    for name in ("a", "b"):
        run_demo(tmp_path / name, capsys, "--preset", "paper", "--seed", "7")
    for file in sorted((tmp_path / "a").glob("*.csv")):
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def view(t_ns: int = 2_500_000_000) -> LoopView:
    contact = ContactMetrics(1.0, (9.0, 9.0), 3.0, 1.0, 700, 0.5, 40.0, (9, 9), in_contact=True)
    felt = [
        Felt(0.9, 0.2, 97.0, 6.0),
        Felt(0.1, 0.8, 3.0, 94.0),
        Felt(0.0, 0.0, 0.0, 0.0),
        Felt(0.0, 0.0, 0.0, 0.0),
    ]
    vest = vest_frame([f.front for f in felt], [f.back for f in felt], layout="x40")
    contacts = {"thumb": (t_ns, contact), "index": (t_ns, contact)}
    counts = {"touch": 150, "vest": 75}
    return LoopView(t_ns, contacts, felt, vest, (t_ns, (2, 3, 3), 3), [0.5] * 16, counts)


def text_of(shown: object) -> str:
    console = Console(width=100)
    with console.capture() as capture:
        console.print(shown)
    return capture.get()


def test_the_screen_shows_fingers_vest_muscles_hand_and_rates() -> None:
    screen = text_of(render(view(), title="test", rates_hz={"touch": 60.0}))
    for word in (
        "thumb",
        "focal",
        "broad",
        "no sensor",
        "front",
        "back",
        "muscle 3",
        "level 3: half",
        "60 Hz",
        "2.5 s",
    ):
        assert word in screen


def test_a_screen_without_input_says_so() -> None:
    nothing = [Felt(0.0, 0.0, 0.0, 0.0)] * 4
    screen = text_of(render(LoopView(0, {}, nothing, None, None, None, {}), title="test", rates_hz={}))
    assert "no EMG yet" in screen
    assert "no vest frame" in screen


def test_the_live_view_draws_ten_times_a_second_at_most_and_measures_rates() -> None:
    now_s = 0.0
    console = Console(width=90, height=40, force_terminal=True)
    with console.capture() as capture, TerminalView("test", console=console, now_s=lambda: now_s) as show:
        for tick in range(61):
            now_s = tick / 30
            show(view()._replace(counts={"touch": 2 * tick}))
    assert 15 <= capture.get().count("╭─ test") <= 25
    assert "touch 60 Hz" in capture.get()


def test_effort_rises_in_steps_and_lets_go() -> None:
    course = [effort_at(t / 10, 10.0) for t in range(101)]
    assert max(course) == pytest.approx(0.97)
    assert course[0] == course[-1] == 0.02
    assert effort_at(-1.0, 10.0) == effort_at(99.0, 10.0) == 0.02


def test_synthetic_touch_is_the_same_however_it_is_read() -> None:
    def frames(skip: int) -> list[bytes]:
        with SyntheticTouch(SyntheticTouchOptions(seed=3, duration_s=0.5, rate_hz=20)) as source:
            source.skip(skip)
            seen = []
            while (frame := source.read(0.0)) is not None:
                seen.append(frame.image.tobytes())
            return seen

    assert len(frames(0)) == 10
    assert frames(4) == frames(0)[4:]


def test_deeper_presses_are_felt_as_larger_and_no_press_as_nothing() -> None:
    gel = Gel(seed=9)
    baseline = gel.still()
    areas = [read_contact(gel.frame([ball(force_n=n)], 0), baseline).eda for n in (0.0, 0.5, 1.5, 5.0)]
    assert areas[0] == 0
    assert areas == sorted(set(areas))


def test_a_press_beside_the_picture_leaves_it_alone() -> None:
    gel = Gel(seed=9)
    beside = gel.frame([ball(force_n=4.0, centre_xy=(-900.0, 10.0))], 4)
    assert not gel.truth.touches
    assert np.array_equal(beside, gel.frame([], 4))


def test_synthetic_emg_follows_effort_and_repeats() -> None:
    effort = np.repeat([0.0, 0.5, 1.0], 2000)
    signal = emg_from_effort(effort, seed=2)
    quiet, half, full = (np.abs(part - part.mean(axis=0)).mean(axis=0) for part in np.split(signal, 3))
    assert np.all(quiet * 10 < half)
    assert full / half == pytest.approx(np.full(3, 2.0), rel=0.1)
    assert np.array_equal(signal, emg_from_effort(effort, seed=2))
    with SyntheticEmg(SyntheticEmgOptions(seed=1, duration_s=0.25)) as source:
        assert sum(len(chunk.samples) for _ in range(5) if (chunk := source.read(0.0)) is not None) == 250
        assert source.ended
