"""Packets of vests and muscle sensors byte for byte, captured from devices or made by other programs."""

from __future__ import annotations

import json

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
