"""Operators that follow a script or a keyboard, and vests that tell nothing."""

from __future__ import annotations

import itertools
import os
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from reference.plant import grasp
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import vest_frame
from tega.runtime.keys import split_keys
from tega_sim.conditions import ShamName, sham_vest
from tega_sim.operator import KeyboardOperator, Keys, ScriptedOperator
from tega_sim.operator.scripted import Step
from tega_sim.seams import Percept, WorldTruth

STILL = WorldTruth(0.0, 0.0, False, (0.0,) * 4, 0.0, 0.0, 0.0, 0.0, False, 0.1)
MADE = vest_frame([80, 60, 40, 20], [10, 0, 100, 55], layout="x40")


def test_the_script_lifts_and_repeats_itself() -> None:
    operator = ScriptedOperator()
    first, second = grasp(operator, None), grasp(operator, None, trial=1)
    assert first.acts == second.acts
    assert first.highest_m > 0.2
    assert not first.dropped
    assert first.acts[-1].phase == "done"


def test_scripts_that_cannot_be_followed_are_refused() -> None:
    step = Step(0.0, "reach", 1, (0.0, 0.0), 1.0)
    for course in ((), (step._replace(t_s=1.0),), (step, step)):
        with pytest.raises(InvalidValueError, match="times rise from 0 s"):
            ScriptedOperator(course)
    with pytest.raises(InvalidValueError, match=r"level = 6 at 0\.0 s"):
        ScriptedOperator([step._replace(level=6)])


def test_keys_drive_level_and_lift() -> None:
    pressed = {10: ["3"], 20: ["right"] * 5, 300: ["up"] * 11, 700: ["down"] * 20, 1000: [" "], 1100: ["q"]}
    ticks = itertools.count()
    operator = KeyboardOperator(lambda: pressed.get(next(ticks), []))
    acts = [operator.act(Percept(tick / 100, STILL, None)) for tick in range(1101)]
    phases = list(dict.fromkeys(act.phase for act in acts))
    assert phases == ["reach", "grasp", "lift", "hold", "place", "release", "done"]
    assert acts[250].excitation == pytest.approx(0.7 * 0.625, rel=1e-3)
    assert acts[650].forearm_m == pytest.approx((0.22, 0.0))
    assert acts[-1].forearm_m == pytest.approx((0.0, 0.0))
    fastest = np.max(np.abs(np.diff([act.forearm_m for act in acts], axis=0)))
    assert fastest == pytest.approx(0.0015)


@pytest.mark.parametrize(
    ("sent", "keys", "rest"),
    [
        (b"12 q", ["1", "2", " ", "q"], b""),
        (b"\x1b[A\x1bOB\x1b[C\x1b[D", ["up", "down", "right", "left"], b""),
        (b"\x1b[5~3", ["3"], b""),  # page up is not level 5
        (b"\x1b[1;5A", ["up"], b""),
        (b"4\x1b", ["4"], b"\x1b"),
        (b"\x1b[", [], b"\x1b["),
        (b"\xc3\xa4\x7f2", ["\x7f", "2"], b""),
    ],
)
def test_what_a_terminal_sends_is_split_into_keys(sent: bytes, keys: list[str], rest: bytes) -> None:
    assert split_keys(sent) == (keys, rest)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_the_terminal_is_put_back_however_it_ends() -> None:
    import pty
    import termios

    master, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)

    def use() -> None:
        with Keys(terminal) as keys:
            assert termios.tcgetattr(terminal) != before
            assert keys.read() == []
            os.write(master, b"3\x1b[A")
            assert keys.read() == ["3", "up"]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        use()
    assert termios.tcgetattr(terminal) == before
    os.close(master)
    os.close(terminal)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_a_file_is_not_a_keyboard(tmp_path: Path) -> None:
    with (
        (tmp_path / "input").open("w+") as file,
        pytest.raises(DeviceUnavailableError, match="not a terminal"),
    ):
        Keys(file.fileno()).__enter__()


def test_each_sham_does_what_it_says() -> None:
    worn = {name: sham_vest(name, seed=3, recorded=[(0.0, MADE)])(1.0, MADE) for name in get_args(ShamName)}
    assert (worn["informative"], worn["off"]) == (MADE, None)
    levels = {name: frame.intensities for name, frame in worn.items() if frame is not None}
    assert not levels["silent"].any()
    assert set(levels["constant"].tolist()) == {50}
    rows, mixed = MADE.intensities.reshape(-1, 4), levels["permuted"].reshape(-1, 4)
    assert np.array_equal(np.sort(rows, axis=1), np.sort(mixed, axis=1))
    assert np.all(np.any(rows != mixed, axis=1))
    assert levels["inverted"][:4].tolist() == [20, 40, 60, 80]
    assert levels["inverted"][21] == 0


def test_the_unrelated_vest_covers_its_range_and_ignores_the_grip() -> None:
    first, second = sham_vest("unrelated", seed=1), sham_vest("unrelated", seed=1)
    still = vest_frame([0.0] * 4, [0.0] * 4, layout="x40")
    displayed = []
    for n in range(9_000):
        a, b = first(n / 30, MADE), second(n / 30, still)
        assert a == b is not None
        displayed.append(b.intensities[[0, 20]])
    front, back = np.array(displayed, float).T
    assert np.quantile(front, [0.1, 0.5, 0.9]) == pytest.approx([10, 50, 90], abs=8)
    assert abs(np.corrcoef(front, back)[0, 1]) < 0.2
    assert np.corrcoef(front[1:], front[:-1])[0, 1] > 0.9


def test_a_replayed_vest_keeps_the_times_of_its_trial() -> None:
    other = vest_frame([1] * 4, [2] * 4, layout="x40")
    vest = sham_vest("replayed", recorded=[(0.0, other), (1.0, MADE)])
    assert vest(0.5, MADE) is other
    assert vest(1.0, other) is MADE
    assert vest(99.0, other) is MADE
    with pytest.raises(InvalidValueError, match="recorded has no frame"):
        sham_vest("replayed")
    with pytest.raises(InvalidValueError, match="sham = 'placebo' is not known"):
        sham_vest("placebo")  # type: ignore[arg-type]
