"""Encode and decode the packets of robot hand, vest and muscle sensors.

Nothing here opens a port, reads a clock or starts a thread. Encoders take values and return bytes, frames or text;
decoders of streams are objects fed with bytes as they arrive. They accept any bytes, and return the same packets for
every way of cutting the stream into chunks. ``docs/wire.md`` has the byte tables, and states which entries are
certain.

============================  =======================================================================
Allegro Hand, CAN             :func:`allegro_torque_frames`, :func:`allegro_decode`, ...
bHaptics vest, BLE            :func:`x40_ble_frame`, :func:`x40_ble_levels`, :func:`x16_levels`
bHaptics vest, sockets        :func:`player_v2_message`, :func:`sdk3_dot_message`, :func:`hub_line`, ...
USB bridge or home-made vest  :func:`hid_motor_report`, :func:`hid_stop_report`, :func:`hid_status`, ...
Muscle sensors, serial        :class:`CytonDecoder`, :class:`ChordsDecoder`, :class:`SpikerDecoder`,
                              :class:`AsciiEmgDecoder`
============================  =======================================================================

Example:
    >>> import numpy as np
    >>> from tega.wire import allegro_torque_frames
    >>> frame = allegro_torque_frames(np.full(16, 0.1))[0]
    >>> hex(frame.id), frame.data.hex(" ")
    ('0x180', '78 00 78 00 78 00 78 00')
"""

from __future__ import annotations

from tega._native import ALLEGRO_PWM_LIMITS, ALLEGRO_RAD_PER_COUNT
from tega.wire.allegro import (
    allegro_angle_counts,
    allegro_angles_rad,
    allegro_decode,
    allegro_limp_frames,
    allegro_position_frames,
    allegro_report_frame,
    allegro_request_imu,
    allegro_request_info,
    allegro_request_position,
    allegro_request_serial,
    allegro_request_temperature,
    allegro_requested,
    allegro_servo_off,
    allegro_servo_on,
    allegro_set_period,
    allegro_torque_frames,
)
from tega.wire.allegro_messages import (
    HAND_FINGERS,
    AllegroConfig,
    AllegroImu,
    AllegroInfo,
    AllegroMessage,
    AllegroPeriod,
    AllegroPose,
    AllegroPosition,
    AllegroRejected,
    AllegroRequest,
    AllegroSerial,
    AllegroServo,
    AllegroStatus,
    AllegroTemperature,
    AllegroTorque,
    CanFrame,
)
from tega.wire.bhaptics_player import (
    PlayerStatus,
    Sdk3Device,
    Sdk3Message,
    hub_line,
    player_v2_message,
    player_v2_ping,
    player_v2_status,
    player_v2_stop,
    sdk3_auth_message,
    sdk3_dot_message,
    sdk3_server_message,
    sdk3_stop_message,
    sdk3_stop_request,
)
from tega.wire.streams import (
    AsciiEmgDecoder,
    ChordsBatch,
    ChordsDecoder,
    CytonBatch,
    CytonDecoder,
    SpikerDecoder,
    chords_channels,
)
from tega.wire.vests import (
    HidMotor,
    HidStatus,
    hid_motor,
    hid_motor_report,
    hid_status,
    hid_status_report,
    hid_stop_report,
    vest_levels,
    x16_levels,
    x40_ble_frame,
    x40_ble_levels,
)

__all__ = [
    "ALLEGRO_PWM_LIMITS",
    "ALLEGRO_RAD_PER_COUNT",
    "HAND_FINGERS",
    "AllegroConfig",
    "AllegroImu",
    "AllegroInfo",
    "AllegroMessage",
    "AllegroPeriod",
    "AllegroPose",
    "AllegroPosition",
    "AllegroRejected",
    "AllegroRequest",
    "AllegroSerial",
    "AllegroServo",
    "AllegroStatus",
    "AllegroTemperature",
    "AllegroTorque",
    "AsciiEmgDecoder",
    "CanFrame",
    "ChordsBatch",
    "ChordsDecoder",
    "CytonBatch",
    "CytonDecoder",
    "HidMotor",
    "HidStatus",
    "PlayerStatus",
    "Sdk3Device",
    "Sdk3Message",
    "SpikerDecoder",
    "allegro_angle_counts",
    "allegro_angles_rad",
    "allegro_decode",
    "allegro_limp_frames",
    "allegro_position_frames",
    "allegro_report_frame",
    "allegro_request_imu",
    "allegro_request_info",
    "allegro_request_position",
    "allegro_request_serial",
    "allegro_request_temperature",
    "allegro_requested",
    "allegro_servo_off",
    "allegro_servo_on",
    "allegro_set_period",
    "allegro_torque_frames",
    "chords_channels",
    "hid_motor",
    "hid_motor_report",
    "hid_status",
    "hid_status_report",
    "hid_stop_report",
    "hub_line",
    "player_v2_message",
    "player_v2_ping",
    "player_v2_status",
    "player_v2_stop",
    "sdk3_auth_message",
    "sdk3_dot_message",
    "sdk3_server_message",
    "sdk3_stop_message",
    "sdk3_stop_request",
    "vest_levels",
    "x16_levels",
    "x40_ble_frame",
    "x40_ble_levels",
]
