# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The simulated hand on a virtual CAN bus: it speaks as the real one, and the world moves the same either way."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra 'sim'")
can = pytest.importorskip("can")

from tega.devices.hand.python_can import PythonCan, PythonCanOptions  # noqa: E402
from tega.errors import DeviceUnavailableError  # noqa: E402
from tega.wire import (  # noqa: E402
    AllegroInfo,
    AllegroPosition,
    AllegroTemperature,
    CanFrame,
    allegro_angle_counts,
    allegro_angles_rad,
    allegro_decode,
    allegro_request_info,
    allegro_request_position,
    allegro_request_temperature,
    allegro_servo_off,
    allegro_servo_on,
    allegro_set_period,
    allegro_torque_frames,
)
from tega_emulators.allegro_bus import AllegroOnBus  # noqa: E402
from tega_sim.world import FULL_DUTY_NM, World, hand_controller  # noqa: E402

TICK_S = 0.003


def host(channel):
    driver = PythonCan(PythonCanOptions(channel=channel))
    driver.open()
    return driver


def received(bus):
    frames = []
    while (message := bus.recv(timeout=0)) is not None:
        frames.append(CanFrame(message.arbitration_id, bytes(message.data), message.is_remote_frame))
    return frames


def level_at(t_s):
    return 1 if t_s < 0.3 else 5


def through_the_bus(ticks):
    world, controller = World("bottle", seed=3, start_m=(0.0, 0.0)), hand_controller()
    channel = "test-closed-loop"
    with AllegroOnBus(channel=channel) as hand, can.Bus(interface="virtual", channel=channel) as ears:
        driver = host(channel)
        driver.write(0, [allegro_set_period(3), *allegro_torque_frames(np.zeros(16)), allegro_servo_on()])
        trace = []
        for tick in range(ticks):
            t_s = tick * TICK_S
            hand.tick(t_s, world.angles_rad)
            angles = np.full(16, np.nan)
            for frame in received(ears):
                text = allegro_decode(frame)
                if isinstance(text, AllegroPosition):
                    first = 4 * ("index", "middle", "ring", "thumb").index(text.finger)
                    angles[first : first + 4] = text.angles_rad
            driver.write(0, allegro_torque_frames(controller.step(angles, level_at(t_s))))
            hand.tick(t_s, world.angles_rad)
            world.set_torques(FULL_DUTY_NM * hand.torques)
            world.advance_to((tick + 1) * TICK_S)
            trace.append(world.angles_rad)
        driver.close()
        assert hand.rejected == 0
    return np.array(trace), world.truth()


def directly(ticks, *, rounded):
    world, controller = World("bottle", seed=3, start_m=(0.0, 0.0)), hand_controller()
    trace = []
    for tick in range(ticks):
        angles = world.angles_rad
        if rounded:
            angles = allegro_angles_rad(allegro_angle_counts(angles))
        torques = controller.step(angles, level_at(tick * TICK_S))
        if rounded:
            counts = [np.frombuffer(frame.data, "<i2") for frame in allegro_torque_frames(torques)]
            torques = np.concatenate(counts) / 1200
        world.set_torques(FULL_DUTY_NM * torques)
        world.advance_to((tick + 1) * TICK_S)
        trace.append(world.angles_rad)
    return np.array(trace), world.truth()


def test_the_world_moves_the_same_by_torques_and_by_frames():
    ticks = 1200
    by_frames, held = through_the_bus(ticks)
    by_counts, _ = directly(ticks, rounded=True)
    np.testing.assert_array_equal(by_frames, by_counts)

    by_torques, truth = directly(ticks, rounded=False)
    assert np.abs(by_frames - by_torques).max() < 0.01
    np.testing.assert_allclose(sum(held.pad_force_n), sum(truth.pad_force_n), rtol=0.03)
    assert sum(truth.pad_force_n) > 10


def test_nothing_is_sent_before_a_period_and_no_torque_flows_before_servo_on():
    angles = np.linspace(-0.1, 0.4, 16)
    with (
        AllegroOnBus(channel="test-quiet") as hand,
        can.Bus(interface="virtual", channel="test-quiet") as bus,
    ):
        driver = host("test-quiet")
        hand.tick(0.0, angles)
        assert received(bus) == []
        driver.write(0, allegro_torque_frames(np.full(16, 0.1)))
        hand.tick(0.003, angles)
        assert not hand.torques.any()
        driver.write(0, [allegro_servo_on()])
        hand.tick(0.006, angles)
        np.testing.assert_array_equal(hand.torques, np.full(16, 0.1))
        driver.write(0, [allegro_servo_off()])
        hand.tick(0.009, angles)
        assert not hand.torques.any()
        driver.close()


def test_positions_come_at_the_period_asked_for():
    with (
        AllegroOnBus(channel="test-period") as hand,
        can.Bus(interface="virtual", channel="test-period") as bus,
    ):
        driver = host("test-period")
        driver.write(0, [allegro_set_period(6)])
        counts = []
        for tick in range(20):
            hand.tick(tick * TICK_S, np.zeros(16))
            counts.append(sum(isinstance(allegro_decode(f), AllegroPosition) for f in received(bus)))
        assert counts == [4, 0] * 10
        driver.close()


def test_requests_are_answered():
    angles = np.linspace(-0.1, 0.4, 16)
    with AllegroOnBus(channel="test-ask") as hand, can.Bus(interface="virtual", channel="test-ask") as bus:
        driver = host("test-ask")
        requested = [
            allegro_request_info(),
            allegro_request_position("ring"),
            allegro_request_temperature("thumb"),
        ]
        driver.write(0, [allegro_servo_on(), *requested])
        hand.tick(0.0, angles)
        text = [allegro_decode(f) for f in received(bus) if not f.remote and f.id != allegro_servo_on().id]
        info, position, temperature = text
        assert isinstance(info, AllegroInfo)
        assert info.servo_on
        assert info.side == "right"
        assert isinstance(position, AllegroPosition)
        np.testing.assert_allclose(position.angles_rad, angles[8:12], atol=5e-5)
        assert isinstance(temperature, AllegroTemperature)
        assert temperature.finger == "thumb"
        driver.close()


def test_frames_of_others_are_counted_and_change_nothing():
    with AllegroOnBus(channel="test-odd") as hand, can.Bus(interface="virtual", channel="test-odd") as bus:
        bus.send(can.Message(arbitration_id=0x180, data=b"\x01\x00", is_extended_id=False))
        bus.send(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=False))
        bus.send(can.Message(arbitration_id=0x180, data=bytes(8), is_extended_id=True))
        hand.tick(0.0, np.zeros(16))
        assert hand.rejected == 3
        assert not hand.servo_on


def test_a_hand_off_its_bus_says_so():
    with pytest.raises(DeviceUnavailableError, match="open it first"):
        AllegroOnBus().tick(0.0, np.zeros(16))
