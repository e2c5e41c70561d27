"""Packets of vests, muscle sensors and the hand byte for byte: by hand, from devices, or made by other programs."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from reference import wire as reference
from tega import wire

CCI, EDA = [80, 60, 40, 20], [10, 0, 100, 55]
FOUR_ROWS = CCI * 4 + [0] * 4 + EDA * 4 + [0] * 4
FIVE_ROWS = CCI * 5 + EDA * 5


@pytest.mark.parametrize(
    ("intensities", "mirror", "frame"),
    [
        ([5 * d for d in range(20)] + [0] * 20, False, "225588bbee000000000000000000001043 76a9dc"),
        ([0] * 20 + [5 * d for d in range(20)], False, "00000000000134679acd225588bbee0000000000"),
        (FOUR_ROWS, False, "3636363600 2020202000 f8f8f8f800 9c9c9c9c00"),
        (FOUR_ROWS, True, "c9c9c9c900 2020202000 f8f8f8f800 6363636300"),
    ],
)
def test_bluetooth_frames(intensities: list[int], mirror: bool, frame: str) -> None:
    assert wire.x40_ble_frame(intensities, front_mirror=mirror) == bytes.fromhex(frame)
    assert wire.x40_ble_frame(np.array(intensities, np.uint8), front_mirror=mirror) == bytes.fromhex(frame)


def test_a_frame_of_another_implementation() -> None:
    frame = bytes.fromhex("0123456789abcdef") + bytes(12)
    front = {2: 1, 7: 2, 6: 3, 11: 4, 10: 5, 15: 6, 14: 7, 19: 8, 18: 9}
    back = {0: 10, 1: 11, 4: 12, 5: 13, 8: 14, 9: 15}
    wanted = [front.get(dot, 0) for dot in range(20)] + [back.get(dot, 0) for dot in range(20)]
    assert wire.x40_ble_levels(frame).tolist() == wanted


@pytest.mark.parametrize("intensities", [FOUR_ROWS, FIVE_ROWS])
def test_what_an_x16_makes_of_it(intensities: list[int]) -> None:
    levels = wire.x16_levels(wire.x40_ble_frame(intensities)).tolist()
    assert levels == [12, 9, 6, 3] * 2 + [2, 0, 15, 8] * 2


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
    inner = json.loads(json.loads(wire.sdk3_dot_message(FOUR_ROWS, motors=32))["Message"])
    assert inner["motorValues"] == CCI * 4 + EDA * 4
    assert wire.sdk3_stop_message() == '{"Type":"SdkStopAll"}'


def test_hid_reports() -> None:
    assert wire.hid_motor_report(FOUR_ROWS, sequence=1, ttl_ms=150) == bytes.fromhex(
        "01100100960000 28 503c2814503c2814503c2814503c281400000000 0a0064370a0064370a0064370a00643700000000"
        "000000000000000000000000 79a659de"
    )
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


CYTON = [
    bytes.fromhex(packet)
    for packet in (
        "A000 000000 000000 000000 000000 000000 000000 000000 000000 000000000000 C0",
        "A001 000001 FFFFFF 000002 FFFFFE 000100 FFFF00 010000 FF0000 000000000000 C0",
        "A002 7FFFFF 800000 800001 400000 C00000 7FFFFE 000000 000001 0010FFF01F40 C0",
        "A07F 00117A FFDD0C 005761 FF513D 0001BF FFFE41 01B4E8 FE4B18 000000000000 C0",
        "A0A0 A0A0A0 C0C0C0 00A0C0 A0A0A0 00C0A0 C0C0C0 20A0C0 A0C0A0 A0C0A0C0A0C0 C1",
        "A0FF 000064 0000C8 00012C 000190 0001F4 000258 0002BC 000320 00000001E240 C4",
        "A000 800000 800000 800000 800000 7FFFFF 7FFFFF 7FFFFF 7FFFFF 000000000000 C0",
        "A003 003039 FFCFC7 000000 000000 000000 000000 000000 000000 020003FF0000 C1",
    )
]


def test_cyton_packets() -> None:
    batch = wire.CytonDecoder().feed(b"".join(CYTON))
    assert batch.counters.tolist() == [0, 1, 2, 127, 160, 255, 0, 3]
    assert batch.missing.tolist() == [0, 0, 0, 124, 32, 94, 0, 2]
    assert batch.counts.tolist() == [reference.cyton_counts(packet) for packet in CYTON]
    assert batch.microvolts[6].round(6).tolist() == [-187500.022352] * 4 + [187500.0] * 4
    assert batch.acceleration_g[2].tolist() == [0.002, -0.002, 1.0]
    assert np.isnan(batch.acceleration_g[[0, 4, 5, 7]]).all()
    assert batch.time_ms.tolist() == [-1, -1, -1, -1, -1, 123456, -1, -1]
    assert batch.footers.tolist() == [0xC0, 0xC0, 0xC0, 0xC0, 0xC1, 0xC4, 0xC0, 0xC1]
    assert batch.aux[7].view(">u2").tolist() == [512, 1023, 0]


def test_a_payload_full_of_headers_does_not_capture_the_decoder() -> None:
    five = CYTON[4]
    # Its counter stands still, so nothing tells the packets from what a late start makes of them.
    assert len(wire.CytonDecoder().feed(five[2:] + five * 3)) == 0
    # The same packets with a counter that runs are all found, whatever came before.
    run = b"".join(five[:1] + bytes([n]) + five[2:] for n in range(160, 168))
    batch = wire.CytonDecoder().feed(five[2:] + run)
    assert batch.counters.tolist() == list(range(160, 168))
    assert (batch.counts == reference.cyton_counts(five)).all()


def test_chords_packets() -> None:
    decoder = wire.ChordsDecoder(3)
    counters, missing, samples = decoder.feed(bytes.fromhex("C77C00000000000000 01 C77C0102000800 0FFF 01"))
    assert (counters.tolist(), missing.tolist()) == ([0, 1], [0, 0])
    assert samples.tolist() == [[0, 0, 0], [512, 2048, 4095]]
    # A sync inside the payload: given once the next packet has shown where it begins.
    inside = bytes.fromhex("C77C FF C77C 0001 0100 01")
    assert len(decoder.feed(inside).counters) == 0
    counters, missing, samples = decoder.feed(bytes.fromhex("C77C00000000000000 01"))
    assert (counters.tolist(), missing.tolist()) == ([255, 0], [253, 0])
    assert samples.tolist() == [[51068, 1, 256], [0, 0, 0]]


def test_spiker_frames() -> None:
    decoder = wire.SpikerDecoder(3)
    stream = b"StartUp!" + bytes.fromhex("800000000000 877F00000400 837F007F0100 80")
    assert decoder.feed(stream).tolist() == [[0, 0, 0], [1023, 0, 512], [511, 127, 128]]
    assert (decoder.frames, decoder.bad_frames, decoder.skipped_bytes, decoder.pending_bytes) == (3, 0, 8, 1)


@pytest.mark.parametrize(
    ("line", "samples"),
    [
        (b"2048.0,2066.0,-9.25E-4,", [2048.0, 2066.0, -9.25e-4]),
        (b"1;2;3\r", [1.0, 2.0, 3.0]),
        (b"1\t2\t3", [1.0, 2.0, 3.0]),
        (b"emg1:1,emg2:2,emg3:3", [1.0, 2.0, 3.0]),
        (b"MyoWare Example_01", None),
        (b"1,2", None),
        (b"1,2,nan", None),
        (b"1,2,0x10", None),
        (b"1,2,3,4", None),
        (b"1" * 257, None),
    ],
)
def test_ascii_lines(line: bytes, samples: list[float] | None) -> None:
    decoder = wire.AsciiEmgDecoder(3)
    found = decoder.feed(b"cut\n" + line + b"\n")
    assert found.tolist() == ([] if samples is None else [samples])
    assert (decoder.lines, decoder.rejected_lines) == ((0, 1) if samples is None else (1, 0))
    assert (decoder.dropped_bytes, decoder.pending_bytes) == (4, 0)
    assert decoder.last_rejected == (line[:256] if samples is None else b"")


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
