"""The vests' packets byte for byte: computed by hand, captured from devices, or made by other programs."""

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
    message = wire.player_v2_message([100] + [0] * 39, duration_ms=150, back_key=None)
    assert message == (
        '{"Register":[],"Submit":[{"Type":"frame","Key":"tega_front","Frame":{"Position":"VestFront",'
        '"DurationMillis":150,"DotPoints":[{"Index":0,"Intensity":100}],"PathPoints":[]}}]}'
    )
    assert len(message) == 174
    both = wire.player_v2_message(FOUR_ROWS, duration_ms=150)
    assert len(both) == 1035
    front, back = json.loads(both)["Submit"]
    assert [dot["Index"] for dot in front["Frame"]["DotPoints"]] == list(range(16))
    assert [dot["Index"] for dot in back["Frame"]["DotPoints"]] == [0, 2, 3, 4, 6, 7, 8, 10, 11, 12, 14, 15]
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
    assert (
        wire.player_v2_status('{"Status":null,"ActiveKeys":null}') == wire.player_v2_status("{}") == nothing
    )
    small = '{"connectedDeviceCount":2,"activeKeys":["k"],"status":{"vestBack":[7]}}'
    assert wire.player_v2_status(small) == wire.PlayerStatus(2, (), ("k",), (), (7,))


def test_newer_sockets() -> None:
    values = ",".join(map(str, FOUR_ROWS))
    assert wire.sdk3_dot_message(FOUR_ROWS) == (
        '{"Type":"SdkPlayDotMode","Message":"{\\"requestId\\":1,\\"position\\":0,\\"motorValues\\":['
        + values
        + '],\\"durationMillis\\":150,\\"deviceIndex\\":-1}"}'
    )
    inner = json.loads(json.loads(wire.sdk3_dot_message(FOUR_ROWS, motors=32))["Message"])
    assert inner["motorValues"] == CCI * 4 + EDA * 4
    assert wire.sdk3_stop_message() == '{"Type":"SdkStopAll"}'
    assert wire.hub_line(FOUR_ROWS) == (
        '{"message":"{\\"requestId\\":1,\\"pos\\":0,\\"motors\\":['
        + values
        + '],\\"durationMillis\\":150}","type":"SdkPlayDotMode"}\n'
    )


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
    vest = {
        "position": 0,
        "deviceName": "Tact\x1b[31mSuit" + "X" * 60,
        "connected": True,
        "battery": -1,
        "vsm": 20,
    }
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
