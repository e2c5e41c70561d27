"""What a soak finds missing in a recording, and of the arm in it, on recordings made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tega.config import check_tree
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.records import ArmTarget, Joints, Record, Skip
from tega_campaigns.soak.lost import KeptCounts, check

_MS = 1_000_000


def recorded(folder: Path, records: Sequence[Record]) -> KeptCounts:
    """Record these, and look."""
    tree = {"recording": {"dir": str(folder / "session"), "stop_free_mib": 0.0}}
    settings = check_tree(tree, {}, base=folder).config.recording
    recorder = McapRecorder(SessionFolder(folder / "session"), settings)
    recorder.head({}, {})
    recorder.begin(0, 1_000_000_000_000_000_000)
    for record in records:
        recorder.put(record)
    recorder.finish()
    return check(recorder.path)


def ticks(*at_ms: int) -> list[Record]:
    return [Skip(t_ns=ms * _MS) for ms in at_ms]


def target(at_ms: int, x_m: float) -> ArmTarget:
    return ArmTarget(
        t_ns=at_ms * _MS,
        taken_ns=at_ms * _MS,
        frame="arm_base",
        position=(x_m, 0.0, 0.3),
        quaternion=(0.0, 0.0, 0.0, 1.0),
    )


def test_a_gap_in_the_loop_s_ticks_is_one_though_other_records_go_on(tmp_path: Path) -> None:
    between = [Joints(t_ns=ms * _MS, angles_rad=(0.0,) * 16) for ms in range(100, 800, 30)]
    kept = recorded(tmp_path, [*ticks(0, 33, 66), *between, *ticks(800, 833)])
    assert [till - since for since, till in kept.gaps] == [734 * _MS]
    assert not kept.cut


def test_ticks_without_a_gap_have_none_whatever_else_is_late(tmp_path: Path) -> None:
    late = [Joints(t_ns=-2_000 * _MS, angles_rad=(0.0,) * 16)]
    assert recorded(tmp_path, [*ticks(0, 33), *late, *ticks(66, 99)]).gaps == []


@pytest.mark.parametrize(
    ("places", "n_over"),
    [
        ([(0, 0.5), (10, 0.5025), (20, 0.505)], 0),
        ([(0, 0.5), (10, 0.5026), (20, 0.5051)], 1),
        ([(0, 0.5), (10, 0.45)], 1),
        ([(0, 0.5), (300, 0.6)], 0),
        ([(0, 0.6999), (10, 0.7001)], 1),
    ],
    ids=["as fast as it may", "a little faster", "a jump", "a jump after it was let go", "outside"],
)
def test_targets_beyond_the_arm_s_limits_are_counted(
    places: list[tuple[int, float]], n_over: int, tmp_path: Path
) -> None:
    kept = recorded(tmp_path, [target(ms, x_m) for ms, x_m in places])
    assert (kept.arm_targets, kept.arm_over) == (len(places), n_over)
