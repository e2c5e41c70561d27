"""The HoloLens source against an emulated headset, over a real connection; a person's fingers cannot steer."""

from __future__ import annotations

import math
import socket
import struct
import threading
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.trackers import Steered, some, until
from tega.arm import ArmChain, StampedPose
from tega.devices import driver_class
from tega.devices.registry import list_drivers
from tega.devices.tracker.hololens import HoloLens, HoloLensOptions
from tega.devices.tracker.tracker_thread import DeviceClock
from tega.errors import DeviceUnavailableError, WrongDeviceError
from tega.loop.hand import ModelledAllegro
from tega_emulators.process import Emulator


@pytest.fixture
def headset() -> Iterator[Emulator]:
    with Emulator("hololens") as emulator:
        yield emulator


def opened(headset: Emulator, **options: object) -> HoloLens:
    return HoloLens(HoloLensOptions(**headset.address, **options))  # type: ignore[arg-type]


def test_the_wrist_is_taken_out_of_a_packet_and_nothing_else(headset: Emulator) -> None:
    headset.say("at 0.31 -0.22 -0.53")
    headset.say("turn 0 0.6 0 0.8")
    with opened(headset) as lens:
        # Every other joint is somewhere else in each packet: none of it may be seen in the poses.
        for pose in some(lens):
            assert pose.position_m == pytest.approx((0.31, -0.22, -0.53), abs=2e-3)
            assert pose.quaternion_xyzw == pytest.approx((0, 0.6, 0, 0.8), abs=1e-6)
        assert lens.counts.repeated == 0
        assert lens.problem == ""
    with opened(headset, hand="left") as lens:
        # The left hand of the emulated headset does not tremble: a pose that stays the same is not a new one.
        (pose,) = until(lens, lambda _: lens.counts.repeated > 5)
        assert pose.position_m == pytest.approx((-0.2, -0.3, -0.4))


def test_a_hand_that_is_lost_keeps_its_bytes_and_is_not_believed(headset: Emulator) -> None:
    with opened(headset) as lens:
        last = some(lens)[-1]
        headset.say("lose")
        lost = some(lens, valid=False)
        assert lost[-1].position_m == pytest.approx(last.position_m, abs=2e-3)
        headset.say("find")
        some(lens)
        assert lens.counts.lost >= 10
        headset.say("no-hands")
        some(lens, valid=False)


def test_a_wrist_that_is_guessed_counts_only_if_that_is_wanted(headset: Emulator) -> None:
    headset.say("guess")
    for wanted in (False, True):
        with opened(headset, guessed=wanted) as lens:
            some(lens, valid=wanted)
            assert any("guessed" in note for note in lens.info.notes)


@pytest.mark.slow
def test_a_headset_that_sends_half_of_its_packets_is_reported() -> None:
    with Emulator("hololens", "--rate-hz", "30") as slow, opened(slow) as lens:
        until(lens, lambda _: "rate: " in lens.problem)
        assert "packets a second come, 60 are expected" in lens.problem


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["same", "old-time"])
def test_a_pose_that_is_not_new_is_none(headset: Emulator, fault: str) -> None:
    with opened(headset) as lens:
        steered = Steered(lens)
        steered.hold()
        headset.say(fault)
        steered.until(lambda c: c.state == "stopped")
        assert steered.reasons[-3:] == [
            "no pose came for more than 100 ms",
            "no pose came for more than 300 ms; let the clutch go and press it again",
            "no pose came for more than 1000 ms",
        ]
        assert lens.counts.repeated > 10
        assert lens.problem == ""


@pytest.mark.slow
def test_an_origin_that_is_elsewhere_after_a_restart_does_not_move_the_arm(headset: Emulator) -> None:
    with opened(headset) as lens:
        steered = Steered(lens)
        steered.hold()
        before = steered.at
        # 5 cm: less than what the gate calls a jump.
        headset.say("restart 0.05 0 0")
        command = steered.until(lambda c: c.state == "idle")
        assert command.reason.endswith("let the clutch go and press it again")
        steered.until(lambda c: c.reason == "the clutch is open", clutch=False)
        assert steered.travel_m(before) < 0.005
        steered.hold()
        packets = lens.counts.poses
        steered.until(lambda _: lens.counts.poses > packets + 30)
        assert steered.travel_m(before) < 0.01
        assert lens.counts.connections == 2


@pytest.mark.slow
def test_what_was_held_up_by_the_network_is_as_old_as_it_is(headset: Emulator) -> None:
    with opened(headset) as lens:
        steered = Steered(lens)
        steered.hold()
        before = steered.at
        headset.say("stall 0.8")
        headset.say("wave 0.3 1")
        packets = lens.counts.poses
        steered.until(lambda _: lens.counts.poses > packets + 60)
        assert steered.travel_m(before) < 0.01
        assert any("press it again" in reason for reason in steered.reasons)
        assert lens.counts.connections == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "end", "noticed", "problem"),
    [
        ("freeze", "clear", lambda lens: lens.counts.silent >= 2, "nothing came for 0.3 s, connecting again"),
        ("cut", "clear", lambda lens: lens.counts.broken > 0, ""),
        ("odd-size", "clear", lambda lens: lens.counts.broken > 0, ""),
        ("hide", "show", lambda lens: "cannot be reached" in lens.problem, ""),
    ],
)
def test_a_connection_that_fails_is_made_anew(headset, fault, end, noticed, problem) -> None:
    with opened(headset, silent_s=0.3) as lens:
        some(lens)
        headset.say(fault)
        until(lens, lambda _: noticed(lens))
        assert problem in lens.problem
        headset.say(end)
        some(lens)
        assert lens.problem == ""
        assert any("reconnected" in note for note in lens.info.notes)


def test_what_is_wrong_at_the_start_is_said_in_words(headset: Emulator) -> None:
    headset.say("hide")
    with pytest.raises(DeviceUnavailableError, match="cannot be reached: Connection refused"):
        opened(headset).open()
    headset.say("show")
    headset.say("freeze")
    with pytest.raises(DeviceUnavailableError, match=r"only 0 of a packet's 1948 bytes came within 0\.2 s"):
        opened(headset, connect_s=0.2).open()
    headset.say("clear")
    headset.say("odd-size")
    with pytest.raises(WrongDeviceError, match="a packet of 1937 bytes"):
        opened(headset).open()


def test_another_server_is_no_headset() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            client, _ = server.accept()
            with client:
                client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                client.recv(1)

        answering = threading.Thread(target=answer)
        answering.start()
        options = HoloLensOptions(host="127.0.0.1", port=server.getsockname()[1])
        with pytest.raises(WrongDeviceError, match="another program"):
            HoloLens(options).open()
        answering.join()


@given(
    st.lists(
        st.tuples(st.integers(0, 10**8), st.integers(0, 3 * 10**9), st.booleans()), min_size=1, max_size=60
    )
)
def test_a_device_s_time_never_goes_back_and_is_never_after_it_came(packets) -> None:
    clock, device_ns, arrival_ns, last_ns = DeviceClock(), 0, 0, 0
    for way_ns, late_ns, restarts in packets:
        device_ns = 0 if restarts else device_ns + way_ns
        arrival_ns = max(arrival_ns, arrival_ns + way_ns + late_ns // 1000)
        t_ns = clock.to_host_ns(device_ns, arrival_ns)
        assert last_ns <= t_ns <= arrival_ns
        last_ns = t_ns


def test_a_burst_after_a_stall_is_old_and_a_restart_is_not() -> None:
    clock, step_ns = DeviceClock(), 16_666_667
    for n in range(100):
        assert clock.to_host_ns(n * step_ns, 5 + n * step_ns) == 5 + n * step_ns
    # Three seconds of packets at once: each was measured when it was.
    arrival_ns = 300 * step_ns
    for n in range(100, 280):
        assert clock.to_host_ns(n * step_ns, arrival_ns) == 5 + n * step_ns
    assert clock.n_leaps == 0
    assert clock.to_host_ns(0, arrival_ns + 1) == arrival_ns + 1
    assert clock.n_leaps == 1


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
