"""A run on emulated devices looks at hand and arm for slips, records the looks, and is computed again alike."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from tega.config import check_tree
from tega.recording.mcap_reader import McapReader
from tega.records import HandLook
from tega.records.schema import read
from tega.replay import replay_file
from tega.teleop import LoopView, run_session
from tega_emulators.lab import emulated_lab

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS"),
]
pytest.importorskip("foxglove", reason="comes with the extra record")


def test_a_run_looks_at_hand_and_arm_and_goes_by_touch_while_the_hand_is_silent(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, hand=True, emg_hz=250.0, vest=True, fingers=("index",)) as lab:
        lab.tree["stages"] = {"mapping": {"name": "pulses"}}
        lab.tree["recording"] = {"dir": str(tmp_path / "recorded"), "lossless": True}
        lab.tree["hand"]["options"] |= {"silent_after_ms": 300.0, "reconnects": 5}
        until_s, seen_ns, cycled = time.monotonic() + 60, list[int](), False

        def look(view: LoopView) -> None:
            nonlocal cycled
            seen_ns.append(view.t_ns)
            if not cycled and view.t_ns - seen_ns[0] > 1e9:
                cycled = True
                lab.hand.say("power-cycle")

        summary = run_session(
            check_tree(lab.tree, {}, base=tmp_path).config,
            observer=look,
            stop=lambda: (len(seen_ns) > 0 and seen_ns[-1] - seen_ns[0] > 5e9) or time.monotonic() > until_s,
        )
    file = tmp_path / "recorded" / summary["recording"]["file"]
    looks = [read(HandLook, m.value) for m in McapReader(file).messages() if m.topic == HandLook.topic]
    whole = [look.closure is not None for look in looks]
    turns = [now for n, now in enumerate(whole) if n == 0 or whole[n - 1] != now]
    assert turns[-3:] == [True, False, True], turns
    for one in looks:
        if one.closure is not None:
            assert one.height_m is not None
            assert one.level is not None
            assert 0 < one.height_m < 1
            assert 1 <= one.closure <= 5
            assert len(one.tips_mm) == 4
        assert one.seen_ns >= one.t_ns
    replay = replay_file(file)
    assert replay.same, [stream for stream in replay.streams if stream.differ]
