"""Packets of vests, muscle sensors and the hand in Python: what it makes of them, or adds to them.

The Rust tests of ``tega-wire`` compare packets byte for byte, those of ``property/test_wire.py`` any packet.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from reference import wire as reference
from tega import wire

CCI, EDA = [80, 60, 40, 20], [10, 0, 100, 55]


def test_every_motor_has_its_place_in_a_bluetooth_frame() -> None:
    rising, none = [5 * d for d in range(20)], [0] * 20
    front = bytes.fromhex("225588bbee000000000000000000001043 76a9dc")
    assert wire.x40_ble_frame(rising + none) == front
    back = bytes.fromhex("00000000000134679acd225588bbee0000000000")
    assert wire.x40_ble_frame(np.array(none + rising, np.uint8)) == back


def test_player_version_two() -> None:
    assert wire.player_v2_message([100] + [0] * 39, duration_ms=150, back_key=None) == (
        '{"Register":[],"Submit":[{"Type":"frame","Key":"tega_front","Frame":{"Position":"VestFront",'
        '"DurationMillis":150,"DotPoints":[{"Index":0,"Intensity":100}],"PathPoints":[]}}]}'
    )
    assert wire.player_v2_stop() == '{"Submit":[{"Type":"turnOffAll"}]}'
    assert wire.player_v2_ping() == (
        '{"Submit":[{"Type":"frame","Key":"ping","Frame":{"Position":"FootL","DurationMillis":100,'
        '"DotPoints":[],"PathPoints":[]}}]}'
    )


def test_player_status() -> None:
    status = wire.player_v2_status(
        '{"RegisteredKeys":[],"ActiveKeys":["tega_front"],"ConnectedDeviceCount":1,"ConnectedPositions":["Vest"],'
        '"Status":{"VestFront":[80,60],"VestBack":[0],"Head":[0]},"Later":{}}'
    )
    assert status == wire.PlayerStatus(1, ("Vest",), ("tega_front",), (80, 60), (0,))
    nothing = wire.PlayerStatus(0, (), (), (), ())
    for text in ('{"Status":null,"ActiveKeys":null}', "{}"):
        assert wire.player_v2_status(text) == nothing
    small = '{"connectedDeviceCount":2,"activeKeys":["k"],"status":{"vestBack":[7]}}'
    assert wire.player_v2_status(small) == wire.PlayerStatus(2, (), ("k",), (), (7,))


def test_newer_sockets() -> None:
    inner = json.loads(
        json.loads(wire.sdk3_dot_message(CCI * 4 + [0] * 4 + EDA * 4 + [0] * 4, motors=32))["Message"]
    )
    assert inner["motorValues"] == CCI * 4 + EDA * 4
    assert wire.sdk3_stop_message() == '{"Type":"SdkStopAll"}'


def test_hid_reports() -> None:
    stop = wire.hid_stop_report(sequence=2)
    assert stop == bytes.fromhex("0111020000000028") + bytes(52) + bytes.fromhex("e6efbe8b")
    assert wire.hid_motor(stop) == wire.HidMotor(2, None, 0, request_status=False)
    status = wire.HidStatus(sequence=515, link=2, battery=98, faults=0x8001, uptime_ms=70_000, dropped=3)
    report = reference.hid_report(bytes.fromhex("0210 0302 02 62 0180 70110100 03000000"))
    assert wire.hid_status(report) == status
    assert wire.hid_status_report(status) == report
    unknown = wire.HidStatus(0, 0, None, 0, 0, 0)
    assert wire.hid_status_report(unknown)[5] == 255
    assert wire.hid_status(wire.hid_status_report(unknown)) == unknown


def test_what_the_player_of_version_3_says_of_its_devices() -> None:
    """The vendor's servers and clients write names with a capital or without, and JSON as text or as it is."""
    name = "Tact\x1b[31mSuit" + "X" * 60
    vest = {"position": 0, "deviceName": name, "connected": True, "battery": -1, "vsm": 20}
    arm = {"position": 1, "connected": False, "battery": 26}
    for text in (
        {"Type": "ServerDevices", "Message": json.dumps([vest, arm])},
        {"type": "ServerDevices", "message": [vest, arm]},
    ):
        message = wire.sdk3_server_message(json.dumps(text))
        assert [d.is_vest for d in message.devices] == [True, False]
        assert [d.battery_percent for d in message.devices] == [None, 26]
        assert [d.connected for d in message.devices] == [True, False]
        assert message.devices[0].name.isprintable()
        assert len(message.devices[0].name) == 40
    assert wire.sdk3_server_message('{"Type":"ServerEventList","Message":"["}').devices == ()
    inner = json.loads(json.loads(wire.sdk3_auth_message("lab", 'k"ey'))["Message"])
    assert (inner["applicationId"], inner["sdkApiKey"], inner["version"]) == ("lab", 'k"ey', 1)
    assert wire.sdk3_stop_request(5) == '{"Type":"SdkStopByRequestId","Message":"5"}'


# With acceleration, with the board's time, and with bytes of another use.
CYTON = [
    bytes.fromhex(packet)
    for packet in (
        "A002 7FFFFF 800000 800001 400000 C00000 7FFFFE 000000 000001 0010FFF01F40 C0",
        "A0FF 000064 0000C8 00012C 000190 0001F4 000258 0002BC 000320 00000001E240 C4",
        "A003 003039 FFCFC7 000000 000000 000000 000000 000000 000000 020003FF0000 C1",
    )
]


def test_cyton_packets() -> None:
    batch = wire.CytonDecoder().feed(b"".join(CYTON))
    assert batch.missing.tolist() == [0, 252, 3]
    assert batch.acceleration_g[0].tolist() == [0.002, -0.002, 1.0]
    assert np.isnan(batch.acceleration_g[1:]).all()
    assert batch.time_ms.tolist() == [-1, 123456, -1]
    assert batch.footers.tolist() == [0xC0, 0xC4, 0xC1]
    assert batch.aux[2].view(">u2").tolist() == [512, 1023, 0]


def test_packets_that_are_missing_or_bad_are_counted() -> None:
    chords = wire.ChordsDecoder(3)
    counters, missing, _ = chords.feed(bytes.fromhex("C77C00000000000000 01 C77C0402000800 0FFF 01"))
    assert (counters.tolist(), missing.tolist(), chords.missing_packets) == ([0, 4], [0, 3], 3)
    spiker = wire.SpikerDecoder(3)
    spiker.feed(b"StartUp!" + bytes.fromhex("800000000000 877F0000 80"))
    counted = (spiker.frames, spiker.bad_frames, spiker.skipped_bytes, spiker.pending_bytes)
    assert counted == (1, 1, 12, 1)


ALL_FINGERS = wire.HAND_FINGERS


def test_angles_of_a_finger_are_those_of_its_version() -> None:
    message = wire.allegro_decode(wire.CanFrame(0x08C, bytes.fromhex("340A EFFF AF00 FCFF")))
    assert isinstance(message, wire.AllegroPosition)
    assert (message.finger, message.counts) == ("thumb", (2612, -17, 175, -4))
    np.testing.assert_allclose(message.angles_rad, [0.231849, -0.001509, 0.015534, -0.000355], atol=6e-7)
    of_five = wire.allegro_angles_rad([-566, -323, -112, -50], version=5)
    np.testing.assert_allclose(of_five, [-0.869314, -0.496092, -0.172020, -0.076794], rtol=0, atol=6e-7)
    assert wire.allegro_torque_frames([0.1] * 16, version=5)[0].data[:2] == b"\x8f\0"


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


def test_temperatures_of_a_real_hand() -> None:
    message = wire.allegro_decode(wire.CanFrame(0x0EC, bytes.fromhex("302624F6")))
    assert message == wire.AllegroTemperature("thumb", (48, 38, 36, None))
    assert isinstance(message, wire.AllegroTemperature)
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
    assert wire.allegro_set_period(3).data == bytes.fromhex("0300 0000 0000 0000")
    assert wire.allegro_set_period(3, 0, 500, 100).data == bytes.fromhex("0300 0000 F401 6400")
    of_hand_3 = (wire.allegro_servo_on, wire.allegro_servo_off, wire.allegro_request_info)
    assert [make(device_id=3).id for make in of_hand_3] == [0x103, 0x107, 0x203]
    assert wire.allegro_set_period(0, device_id=3) == (0x207, bytes(8), False)


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


@pytest.mark.parametrize(
    ("frame", "flags", "reason"),
    [
        (wire.CanFrame(0x080, b"", remote=True), {}, "remote"),
        (wire.CanFrame(0x080, bytes(7)), {}, "malformed"),
        (wire.CanFrame(0x080, bytes(8)), {"error": True}, "error"),
        (wire.CanFrame(0x080, bytes(8)), {"extended": True}, "extended"),
        (wire.CanFrame(0x001, bytes(4)), {}, "foreign_device"),
        (wire.CanFrame(0x3C0, bytes(8)), {}, "unknown"),
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
        (0x384, "00" * 8, wire.AllegroPose("middle", (0, 0, 0, 0))),
    ],
)
def test_messages_without_known_meaning_come_raw(can_id: int, data: str, message: object) -> None:
    assert wire.allegro_decode(wire.CanFrame(can_id, bytes.fromhex(data))) == message
