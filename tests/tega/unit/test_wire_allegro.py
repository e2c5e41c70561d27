"""The hand's packets byte for byte: computed by hand, captured from devices, or made by other programs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tega import wire

ALL_FINGERS = wire.HAND_FINGERS


TAU = [0.10, -0.20, 0.05, -0.05, 0, 0.25, -0.10, 0.02, 0.01, 0.15, 0.125, -0.2, 0.3, -0.3, 0.2, -0.2]
POSITIONS = {
    0x080: ("CAFD BDFE 90FF CEFF", (-566, -323, -112, -50), (-0.050240, -0.028671, -0.009941, -0.004438)),
    0x084: ("F9FF CFFE 9AFF BEFF", (-7, -305, -102, -66), (-0.000621, -0.027073, -0.009054, -0.005858)),
    0x088: ("1800 D3FE A7FF D6FF", (24, -301, -89, -42), (0.002130, -0.026718, -0.007900, -0.003728)),
    0x08C: ("340A EFFF AF00 FCFF", (2612, -17, 175, -4), (0.231849, -0.001509, 0.015534, -0.000355)),
}


@pytest.mark.parametrize(
    ("tau", "wanted"),
    [
        (TAU, ["7800 10FF 3C00 C4FF", "0000 2C01 88FF 1800", "0C00 B400 9600 10FF", "6801 98FE F000 10FF"]),
        ([0.65] * 16, ["7701 A302 C201 1D01"] * 3 + ["0D02 9501 0E01 0E01"]),
        ([-0.65] * 16, ["89FE 5DFD 3EFE E3FE"] * 3 + ["F3FD 6BFE F2FE F2FE"]),
    ],
)
def test_torque_frames(tau: list[float], wanted: list[str]) -> None:
    frames = wire.allegro_torque_frames(tau)
    assert frames == [
        wire.CanFrame(can_id, bytes.fromhex(data))
        for can_id, data in zip([0x180, 0x184, 0x188, 0x18C], wanted, strict=True)
    ]


@pytest.mark.parametrize(
    ("can_id", "data", "counts"),
    [
        (0x180, "0200 CB00 4200 2500", (2, 203, 66, 37)),
        (0x184, "0100 B900 4A00 3300", (1, 185, 74, 51)),
        (0x188, "F1FF C900 3800 1F00", (-15, 201, 56, 31)),
        (0x18C, "5802 0500 8DFF FAFF", (600, 5, -115, -6)),
    ],
)
def test_captured_torque_frames(can_id: int, data: str, counts: tuple[int, int, int, int]) -> None:
    message = wire.allegro_decode(wire.CanFrame(can_id, bytes.fromhex(data)))
    assert message == wire.AllegroTorque(ALL_FINGERS[(can_id - 0x180) // 4], counts)


@pytest.mark.parametrize("can_id", POSITIONS)
def test_captured_position_frames(can_id: int) -> None:
    data, counts, angles = POSITIONS[can_id]
    message = wire.allegro_decode(wire.CanFrame(can_id, bytes.fromhex(data)))
    assert isinstance(message, wire.AllegroPosition)
    assert (message.finger, message.counts) == (ALL_FINGERS[(can_id - 0x080) // 4], counts)
    np.testing.assert_allclose(message.angles_rad, angles, rtol=0, atol=6e-7)
    np.testing.assert_array_equal(wire.allegro_angles_rad(counts), message.angles_rad)


def test_home_pose_as_position_frames() -> None:
    degrees = [0, -10, 45, 45, 0, -10, 45, 45, 5, -5, 50, 45, 60, 25, 15, 45]
    frames = wire.allegro_position_frames(np.radians(degrees))
    data = ["000052f890229022", "000052f890229022", "d70329fc67269022", "162e3413850b9022"]
    assert [frame.data.hex() for frame in frames] == data
    assert frames == wire.allegro_position_frames(np.radians(degrees), device_id=0)
    back = wire.allegro_angles_rad(np.concatenate([np.frombuffer(frame.data, "<i2") for frame in frames]))
    wanted = [0, -0.174508, 0.785376, 0.785376, 0, -0.174508, 0.785376, 0.785376]
    wanted += [0.087254, -0.087254, 0.872631, 0.785376, 1.047228, 0.436360, 0.261763, 0.785376]
    np.testing.assert_allclose(back, wanted, rtol=0, atol=6e-7)


def test_information_of_a_real_hand() -> None:
    info = wire.allegro_decode(wire.CanFrame(0x200, bytes.fromhex("0204 0604 00 3C 05")))
    assert info == wire.AllegroInfo((4, 2), (4, 6), "right", 60, 0b101)
    assert isinstance(info, wire.AllegroInfo)
    assert (info.servo_on, info.must_stop, info.must_warn) == (True, False, True)
    assert wire.allegro_report_frame(info).data == bytes.fromhex("0204 0604 00 3C 05")
    for status, must_stop in ((0, False), (0b10, True), (0b10000, True), (0b10011, True)):
        answer: Any = wire.allegro_decode(
            wire.CanFrame(0x200, bytes.fromhex("0204 0604 00 3C") + bytes([status]))
        )
        assert (answer.servo_on, answer.must_stop) == (bool(status & 1), must_stop)


@pytest.mark.parametrize(
    ("can_id", "data", "celsius"),
    [
        (0x0E0, "2B2A2925", (43, 42, 41, 37)),
        (0x0E4, "292B2927", (41, 43, 41, 39)),
        (0x0E8, "27272724", (39, 39, 39, 36)),
        (0x0EC, "302624F6", (48, 38, 36, None)),
    ],
)
def test_temperatures_of_a_real_hand(can_id: int, data: str, celsius: tuple[int | None, ...]) -> None:
    message = wire.allegro_decode(wire.CanFrame(can_id, bytes.fromhex(data)))
    assert isinstance(message, wire.AllegroTemperature)
    assert (message.finger, message.celsius) == (ALL_FINGERS[(can_id - 0x0E0) // 4], celsius)
    assert wire.allegro_decode(wire.allegro_report_frame(message)) == message


def test_commands_and_requests() -> None:
    assert wire.allegro_servo_on() == (0x100, b"", False)
    assert wire.allegro_servo_off() == (0x104, b"", False)
    assert wire.allegro_request_info() == (0x200, b"", True)
    assert wire.allegro_request_serial() == (0x220, b"", True)
    assert wire.allegro_request_imu() == (0x0C0, b"", True)
    assert [wire.allegro_request_position(f).id for f in ALL_FINGERS] == [0x080, 0x084, 0x088, 0x08C]
    assert [wire.allegro_request_temperature(f).id for f in ALL_FINGERS] == [0x0E0, 0x0E4, 0x0E8, 0x0EC]
    assert wire.allegro_set_period(3, 0, 0, None) == (0x204, bytes.fromhex("0300 0000 0000"), False)
    assert wire.allegro_set_period(3, 0, 500, None).data == bytes.fromhex("0300 0000 F401")
    assert wire.allegro_set_period(3).data == bytes.fromhex("0300 0000 0000 0000")
    assert wire.allegro_set_period(3, 0, 500, 100).data == bytes.fromhex("0300 0000 F401 6400")
    assert wire.allegro_set_period(0).data == bytes(8)
    for device in (1, 3):
        assert wire.allegro_servo_on(device_id=device).id == 0x100 + device
        assert wire.allegro_servo_off(device_id=device).id == 0x104 + device
        assert wire.allegro_request_info(device_id=device).id == 0x200 + device
        assert wire.allegro_set_period(0, device_id=device).id == 0x204 + device


def test_a_simulated_hand_reads_what_the_host_sends() -> None:
    assert wire.allegro_decode(wire.allegro_servo_on()) == wire.AllegroServo(on=True)
    assert wire.allegro_decode(wire.allegro_servo_off()) == wire.AllegroServo(on=False)
    assert wire.allegro_decode(wire.allegro_set_period(3, 0, 500)) == wire.AllegroPeriod(3, 0, 500, 0)
    assert wire.allegro_decode(wire.allegro_set_period(3, 0, 0, None)) == wire.AllegroPeriod(3, 0, 0, None)
    assert wire.allegro_requested(wire.allegro_request_info()) == wire.AllegroRequest("info", None)
    thumb = wire.allegro_request_temperature("thumb", device_id=2)
    assert wire.allegro_requested(thumb, device_id=2) == wire.AllegroRequest("temperature", "thumb")
    assert wire.allegro_requested(thumb) is None
    assert wire.allegro_requested(wire.CanFrame(0x200, b"")) is None
    serial = wire.AllegroSerial("A080R")
    assert wire.allegro_report_frame(serial) == (0x220, b"A080R\0\0\0", False)
    assert wire.allegro_decode(wire.allegro_report_frame(serial)) == serial
    odd = wire.allegro_decode(wire.CanFrame(0x220, b"\xff\x07ok\0\0\0\0"))
    assert odd == wire.AllegroSerial("\\xff\\x07ok")


def test_version_five() -> None:
    index = wire.allegro_torque_frames(TAU, version=5)[0]
    # 71.5 counts: truncated to 71 in the vector, rounded to 72 here.
    assert index == (0x180, bytes.fromhex("8F00 10FF 4800 B8FF"), False)
    vector = np.frombuffer(bytes.fromhex("8F00 10FF 4700 B9FF"), "<i2")
    assert np.abs(np.frombuffer(index.data, "<i2") - vector).max() == 1
    wrong = wire.allegro_angles_rad(POSITIONS[0x080][1], version=5)
    np.testing.assert_allclose(wrong, [-0.869314, -0.496092, -0.172020, -0.076794], rtol=0, atol=6e-7)


@pytest.mark.parametrize(
    ("frame", "flags", "reason"),
    [
        (wire.CanFrame(0x080, b"", remote=True), {}, "remote"),
        (wire.CanFrame(0x080, bytes(7)), {}, "malformed"),
        (wire.CanFrame(0x184, bytes(4)), {}, "malformed"),
        (wire.CanFrame(0x080, bytes(8)), {"error": True}, "error"),
        (wire.CanFrame(0x080, bytes(8)), {"extended": True}, "extended"),
        (wire.CanFrame(0x001, bytes(4)), {}, "foreign_device"),
        (wire.CanFrame(0x082, bytes(8)), {}, "foreign_device"),
        (wire.CanFrame(0x3C0, bytes(8)), {}, "unknown"),
        (wire.CanFrame(0x3C8, bytes(8)), {}, "unknown"),
        (wire.CanFrame(-1, bytes(8)), {}, "extended"),
    ],
)
def test_what_is_not_for_us_has_a_reason(frame: wire.CanFrame, flags: dict[str, bool], reason: Any) -> None:
    assert wire.allegro_decode(frame, **flags) == wire.AllegroRejected(reason)


@pytest.mark.parametrize(
    ("can_id", "data", "message"),
    [
        (0x040, "0102", wire.AllegroStatus(b"\1\2")),
        (0x0C0, "0100 FFFF 0300", wire.AllegroImu((1, -1, 3))),
        (0x1A0, "00" * 6, wire.AllegroConfig(bytes(6))),
        (0x160, "00" * 6, wire.AllegroConfig(bytes(6))),
        (0x384, "00" * 8, wire.AllegroPose("middle", (0, 0, 0, 0))),
    ],
)
def test_messages_without_known_meaning_come_raw(can_id: int, data: str, message: object) -> None:
    assert wire.allegro_decode(wire.CanFrame(can_id, bytes.fromhex(data))) == message
