"""A person's fingers cannot steer: no tracker's driver hands them on, and what it hands on has no room for them."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.arm import ArmChain, StampedPose
from tega.devices import driver_class
from tega.devices.registry import list_drivers
from tega.devices.tracker.hololens import HoloLens, HoloLensOptions
from tega.loop.hand import ModelledAllegro

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.devices.base import SteeredHand
    from tega.loop.hand import Hand

    def refused(hand: Hand, steered: SteeredHand, pose: StampedPose, joints_m: NDArray[np.float64]) -> None:
        """mypy, which `make lint` runs, fails on each of these lines as soon as one of these types is accepted."""
        hand.step(pose)  # type: ignore[arg-type]
        hand.step(joints_m)  # type: ignore[arg-type]
        steered.step(pose)  # type: ignore[arg-type]
        steered.step(joints_m)  # type: ignore[arg-type]


# One packet of the headset's spatial input: time, size, validity; head and eyes; 26 joints of each hand.
_JOINT_BYTES, _PACKET_BYTES = 36, 1948
_WRIST_AT = {"left": 76 + _JOINT_BYTES, "right": 1012 + _JOINT_BYTES}


def packet(number: int, hand: str, rest: bytes) -> bytes:
    data = bytearray(rest)
    data[:16] = struct.pack("<QII", 10_000_000 + 166_667 * number, 1936, 0b1111)
    wrist = struct.pack("<4f3ffi", 0.0, 0.6, 0.0, 0.8, 0.01 * number, -0.2, -0.4, 0.01, 0)
    data[_WRIST_AT[hand] : _WRIST_AT[hand] + _JOINT_BYTES] = wrist
    return bytes(data)


@pytest.mark.parametrize("hand", ["left", "right"])
@given(seed=st.integers(0, 2**32 - 1))
def test_no_byte_of_a_packet_but_the_wrist_s_changes_a_pose(hand: str, seed: int) -> None:
    rng, seen = np.random.default_rng(seed), []
    for fingers in ("still", "moving"):
        lens = HoloLens(HoloLensOptions(host="headset", hand=hand))  # type: ignore[arg-type]
        for number in range(5):
            rest = rng.bytes(_PACKET_BYTES) if fingers == "moving" else bytes(_PACKET_BYTES)
            lens._take(packet(number, hand, rest), 1_000_000_000 + 16_666_700 * number)
        seen.append(list(lens._poses))
    assert len(seen[0]) == 5
    assert seen[0] == seen[1]


def test_every_tracker_hands_on_one_place_and_one_turn() -> None:
    assert StampedPose._fields == ("t_ns", "position_m", "quaternion_xyzw", "valid")
    trackers = [found.name for found in list_drivers() if found.kind == "tracker"]
    assert {"hololens", "poses-file"} <= set(trackers)
    for name in trackers:
        assert get_type_hints(driver_class(name, "tracker").read)["return"] == Sequence[StampedPose]


@pytest.mark.parametrize("joints_m", [np.zeros((26, 3)), np.zeros(78)])
def test_joints_in_the_place_of_a_place_steer_no_arm(joints_m: NDArray[np.float64]) -> None:
    chain = ArmChain()
    measured = StampedPose(0, (0.5, 0.0, 0.3), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))
    for number in range(100):
        now_ns = 10_000_000 * number
        pose = StampedPose(now_ns, joints_m, (0.0, 0.0, 0.0, 1.0))
        command = chain.step(
            now_ns, [pose], clutch=number > 5, dead_man=True, measured=measured._replace(t_ns=now_ns)
        )
        assert command.target is None
    assert f"it is not one place and one turn: shapes {joints_m.shape}" in command.reason


@pytest.mark.parametrize("fingers", [StampedPose(0, (0, 0, 0), (0, 0, 0, 1)), np.zeros((26, 3))])
def test_neither_a_pose_nor_joints_pass_for_a_level(fingers: object) -> None:
    with pytest.raises(TypeError):
        ModelledAllegro().step(fingers)  # type: ignore[arg-type]
