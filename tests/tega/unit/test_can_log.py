"""CAN logs that python-can's writers made, decoded into states of a hand."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reference.can_logs import conversation, write_log
from reference.command import call
from reference.mutated import draw_changes, mutated
from tega.devices.hand.can_log import LOG_SUFFIXES, HandLog, find_hand, read_can_log
from tega.errors import RecordingError, TegaError
from tega.hand import JOINT_NAMES
from tega.wire import (
    CanFrame,
    allegro_angles_rad,
)

_FEW = settings(
    max_examples=settings().max_examples // 8,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def states_of(path: Path, **which: Any) -> tuple[Any, list[Any]]:
    log = HandLog(
        *find_hand(read_can_log(path), device_id=which.get("device_id"), channel=which.get("channel"))
    )
    return log.facts, list(log.states(read_can_log(path)))


@pytest.mark.parametrize(
    "suffix", [pytest.param(s, marks=[pytest.mark.slow] if s == ".mf4" else []) for s in LOG_SUFFIXES]
)
@_FEW
@given(
    counts=st.lists(st.lists(st.integers(-400, 400), min_size=16, max_size=16), min_size=2, max_size=6),
    device_id=st.integers(0, 3),
)
def test_every_log_of_python_can_gives_the_states_that_were_sent(
    suffix: str, counts: list[list[int]], device_id: int, tmp_path: Path
) -> None:
    frames = conversation(counts, device_id=device_id)
    facts, states = states_of(write_log(tmp_path / f"a{suffix}", frames))
    assert (facts.device_id, facts.sets, facts.incomplete) == (device_id, len(counts), 0)
    assert (facts.hardware, facts.firmware, facts.side, facts.serial) == ("4.2", "4.6", "right", "0123")
    np.testing.assert_allclose(
        [state.angles_rad for state in states], [allegro_angles_rad(row) for row in counts]
    )
    assert states[0].torque_counts is None
    assert states[-1].torque_counts is not None
    assert states[-1].servo_on is True
    assert states[-1].celsius[:4] == [30, 31, None, 33]
    assert states[1].t_s - states[0].t_s == pytest.approx(0.008, abs=0.002)


def test_other_frames_are_counted_and_a_missing_finger_costs_its_set(tmp_path: Path) -> None:
    frames = conversation([[1] * 16, [2] * 16])
    del frames[8]  # a finger of the first set
    frames += [CanFrame(0x7AB, b"\1"), CanFrame(0x080, b"", remote=True)]
    facts, states = states_of(write_log(tmp_path / "a.log", frames))
    assert (facts.sets, facts.incomplete, len(states)) == (1, 1, 1)
    assert facts.kinds["foreign_device"] == facts.kinds["remote"] == 1


def test_two_hands_have_to_be_told_apart(tmp_path: Path) -> None:
    frames = conversation([[1] * 16], device_id=0) + conversation([[2] * 16], device_id=2)
    path = write_log(tmp_path / "a.blf", frames)
    with pytest.raises(
        RecordingError, match=r"several hands .*: 0 on \S+ \(4 frames\), 2 on \S+ \(4 frames\)"
    ):
        states_of(path)
    facts, (state,) = states_of(path, device_id=2)
    assert facts.device_id == 2
    np.testing.assert_allclose(state.angles_rad, allegro_angles_rad([2] * 16))


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.csv", b"x", r"its name has to end in \.asc, \.blf, \.log, \.trc, \.mf4"),
        ("a.log", b"", "holds no CAN frame"),
        ("a.blf", b"no log", "damaged after 0 frames"),
        ("a.log", b"(1.0) can0 123#01\n(2.0) can0 12", "damaged after 1 frames"),
        ("a.log", b"(1.0) can0 7AB#01\n", r"no hand reports joint angles in its 1 frames \(buses: can0\)"),
    ],
)
def test_what_is_no_log_of_a_hand_is_refused(name: str, content: bytes, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=text):
        states_of(tmp_path / name)
    with pytest.raises(RecordingError, match="cannot be read"):
        states_of(tmp_path / "none.log")


@pytest.mark.parametrize("n", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_a_damaged_mf4_ends_with_an_error_of_tega(
    n: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = write_log(tmp_path / "a.mf4", conversation([[k] * 16 for k in range(3)])).read_bytes()
    rng = random.Random(1)
    for k in range(n):
        (tmp_path / "b.mf4").write_bytes(mutated(whole, draw_changes(rng)))
        with contextlib.suppress(TegaError):
            assert len(states_of(tmp_path / "b.mf4")[1]) <= 3 * 3, k
    assert capfd.readouterr() == ("", "")


def test_hand_decode_writes_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path / "a.log", conversation([[k] * 16 for k in range(5)]), channel="can0")
    out, _ = call(capsys, "hand", "decode", path, "--out", tmp_path / "states.csv", "--json")
    facts = json.loads(out)
    assert (facts["sets"], facts["channel"], facts["last"]["servo_on"]) == (5, "can0", "1")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "states.csv").read_text())))
    assert len(rows) == 5
    assert float(rows[4][f"{JOINT_NAMES[15]}_rad"]) == pytest.approx(
        allegro_angles_rad([4] * 16)[15], abs=1e-6
    )
    text, _ = call(capsys, "hand", "decode", path)
    assert "hand 0 on bus can0: version 4.2, firmware 4.6, right; serial 0123" in text
