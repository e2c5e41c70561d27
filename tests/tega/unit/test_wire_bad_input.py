"""What cannot be encoded is refused by name, value and unit; what a port delivers never raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tega import wire
from tega.errors import DtypeError, InvalidValueError, ShapeError, TegaError, WireError

FORTY = np.zeros(40, np.uint8)
Call = Callable[[], Any]


BAD: dict[type[TegaError], list[tuple[Call, str]]] = {
    WireError: [
        (lambda: wire.allegro_torque_frames([0.0] * 5 + [np.nan] + [0.0] * 10), r"torques\[5\] = NaN tau"),
        (lambda: wire.allegro_torque_frames([0.0] * 16, device_id=4), "device_id = 4"),
        (lambda: wire.allegro_torque_frames([0.0] * 16, device_id=-1), "device_id = -1"),
        (lambda: wire.allegro_position_frames([3.0] * 16), "angle_rad = 3 rad"),
        (lambda: wire.allegro_angle_counts(np.nan), "angle_rad = NaN rad"),
        (lambda: wire.allegro_angles_rad([40000]), r"counts\[0\] = 40000"),
        (lambda: wire.allegro_set_period(70000), "70000"),
        (lambda: wire.allegro_report_frame(wire.AllegroSerial("123456789")), "123456789"),
        (lambda: wire.x40_ble_frame(FORTY + 101), r"intensities\[0\] = 101 %"),
        (lambda: wire.x40_ble_frame([-1] + [0] * 39), r"intensities\[0\] = -1"),
        (lambda: wire.x40_ble_levels(bytes(19)), "vest frame of 19 bytes"),
        (lambda: wire.x16_levels(bytes(21)), "vest frame of 21 bytes"),
        (lambda: wire.player_v2_message(FORTY, duration_ms=19), "duration_ms = 19 ms"),
        (lambda: wire.player_v2_message(FORTY, duration_ms=-1), "duration_ms = -1"),
        (lambda: wire.player_v2_message(FORTY, duration_ms=50, front_key=""), "front_key is empty"),
        (
            lambda: wire.player_v2_message(FORTY, duration_ms=50, front_key=None, back_key=None),
            "name at least one panel",
        ),
        (lambda: wire.player_v2_stop(""), "key is empty"),
        (lambda: wire.player_v2_status("{"), "not JSON: Input data was truncated"),
        (lambda: wire.player_v2_status("[1,[],[],null]"), "player status: not a JSON object"),
        (lambda: wire.player_v2_status("[" * 10_000), "not JSON"),
        (
            lambda: wire.player_v2_status('{"Status":{"VestFront":"x"}}'),
            "player status: Expected `array`, got `str`",
        ),
        (lambda: wire.sdk3_dot_message(FORTY + 1, motors=32), r"intensities\[16\] = 1 is in row 4"),
        (lambda: wire.sdk3_server_message("[" * 5000), "not JSON"),
        (lambda: wire.sdk3_server_message("[]"), "without a type"),
        (lambda: wire.sdk3_server_message('{"Type":7}'), "without a type"),
        (
            lambda: wire.sdk3_server_message('{"Type":"ServerDevices","Message":"{}"}'),
            "no list of at most 64 devices",
        ),
        (
            lambda: wire.sdk3_server_message('{"Type":"ServerDevices","Message":[{"position":true}]}'),
            "no device of the Player",
        ),
        (lambda: wire.sdk3_dot_message(FORTY, request_id=-1), "request_id = -1"),
        (lambda: wire.hub_line(FORTY, duration_ms=200_000), "duration_ms = 200000 ms"),
        (lambda: wire.hid_motor_report(FORTY, sequence=0, ttl_ms=0), "ttl_ms = 0 ms"),
        (lambda: wire.hid_motor_report(FORTY, sequence=65536, ttl_ms=1), "sequence = 65536"),
        (lambda: wire.hid_status(bytes(64)), "report number is 0x0, 0x2 is needed"),
        (lambda: wire.hid_status(bytes([2, 0x20]) + bytes(62)), "format version is 0x2"),
        (lambda: wire.hid_status(bytes([2, 0x10]) + bytes(62)), "checksum in the packet is 0x00000000"),
        (lambda: wire.hid_status(bytes(63)), "status report of 63 bytes, 64 are needed"),
        (lambda: wire.hid_motor(bytes(65)), "motor report of 65 bytes"),
        (lambda: wire.hid_status_report(wire.HidStatus(0, 0, None, -1, 0, 0)), "faults = -1"),
    ],
    ShapeError: [
        (lambda: wire.allegro_torque_frames([0.0] * 15), r"torques has shape \(15,\)"),
        (lambda: wire.allegro_torque_frames(np.zeros((4, 4))), r"torques has shape \(4, 4\)"),
        (lambda: wire.allegro_report_frame(wire.AllegroImu((1,))), "imu has 1 elements"),
        (lambda: wire.allegro_report_frame(wire.AllegroStatus(bytes(9))), "status has 9 elements"),
        (lambda: wire.x40_ble_frame(FORTY[:32]), r"intensities has shape \(32,\)"),
        (lambda: wire.hid_motor_report(FORTY[:33], sequence=0, ttl_ms=1), r"intensities has shape"),
    ],
    DtypeError: [
        (lambda: wire.allegro_torque_frames(["a"] * 16), "torques has dtype"),
        (lambda: wire.allegro_angles_rad([0.5]), "counts has dtype float64"),
        (lambda: wire.allegro_decode(wire.CanFrame(0x80, "text")), "data is str"),  # type: ignore[arg-type]
        (lambda: wire.x40_ble_frame(FORTY * 0.5), "intensities has dtype float64"),
        (lambda: wire.CytonDecoder().feed("text"), "data is str"),  # type: ignore[arg-type]
        (lambda: wire.CytonDecoder().feed(7), "data is int"),  # type: ignore[arg-type]
    ],
    InvalidValueError: [
        (lambda: wire.x40_ble_frame(np.ma.masked_equal(FORTY, 0)), "intensities has 40 masked values"),
        (lambda: wire.allegro_torque_frames([0.0] * 16, version=3), "version = 3"),  # type: ignore[arg-type]
        (lambda: wire.allegro_request_position("little"), "finger = 'little'"),  # type: ignore[arg-type]
        (lambda: wire.sdk3_auth_message("", "key"), "may not be empty"),
        (lambda: wire.sdk3_dot_message(FORTY, motors=20), "motors = 20"),  # type: ignore[arg-type]
        (lambda: wire.CytonDecoder(5), "gain = 5 is out of range: 1, 2, 4, 6, 8, 12 or 24"),
        (lambda: wire.CytonDecoder(280), "gain = 280"),
        (lambda: wire.ChordsDecoder(0), "channels = 0"),
        (lambda: wire.SpikerDecoder(7), "channels = 7"),
        (lambda: wire.AsciiEmgDecoder(0), "channels = 0"),
        (lambda: wire.AsciiEmgDecoder(3, leading=-1), "leading = -1"),
    ],
}


@pytest.mark.parametrize(
    ("error", "call", "says"), [(error, *case) for error, cases in BAD.items() for case in cases]
)
def test_bad_input_is_named(error: type[TegaError], call: Call, says: str) -> None:
    with pytest.raises(error, match=says):
        call()


def test_strided_and_read_only_arrays_are_read_as_they_stand() -> None:
    values = np.arange(80, dtype=np.uint8)
    strided = values[::2]
    assert not strided.flags.c_contiguous
    assert wire.x40_ble_frame(strided) == wire.x40_ble_frame(strided.copy())
    tau = np.linspace(-0.1, 0.1, 32)[::-2]
    assert wire.allegro_torque_frames(tau) == wire.allegro_torque_frames(tau.tolist())
    assert wire.allegro_torque_frames([0] * 16)[3].data == bytes(8)
    fixed = np.zeros(40, np.uint8)
    fixed.flags.writeable = False
    assert wire.x40_ble_frame(fixed) == bytes(20)


def test_buffers_of_every_kind_are_bytes() -> None:
    line = b"\n1,2,3\n"
    for data in (line, bytearray(line), memoryview(line), memoryview(line)[::1]):
        assert wire.AsciiEmgDecoder(3).feed(data).tolist() == [[1.0, 2.0, 3.0]]


def test_empty_answers_have_their_shapes() -> None:
    batch = wire.CytonDecoder().feed(b"")
    assert (batch.microvolts.shape, batch.counts.shape, batch.aux.shape) == ((0, 8), (0, 8), (0, 6))
    assert len(batch) == 0
    assert wire.ChordsDecoder(6).feed(b"").samples.shape == (0, 6)
    assert wire.SpikerDecoder(2).feed(b"").shape == (0, 2)
    assert wire.AsciiEmgDecoder(4).feed(b"").shape == (0, 4)
