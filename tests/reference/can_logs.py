"""Write CAN logs of a conversation with a hand, by python-can's own writers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import can
import numpy as np

from tega.wire import (
    HAND_FINGERS,
    AllegroInfo,
    AllegroSerial,
    AllegroTemperature,
    CanFrame,
    allegro_angles_rad,
    allegro_position_frames,
    allegro_report_frame,
    allegro_servo_on,
    allegro_torque_frames,
)

_WRITERS: dict[str, Any] = {
    ".asc": can.ASCWriter, ".blf": can.BLFWriter, ".log": can.CanutilsLogWriter, ".trc": can.TRCWriter,
    ".mf4": can.MF4Writer,
}  # fmt: skip
_INFO = AllegroInfo(hardware=(4, 2), firmware=(4, 6), side="right", palm_c=31, status=1)


def write_log(
    path: Path, frames: Sequence[CanFrame], *, channel: int | str = 1, step_s: float = 0.001
) -> Path:
    """Write a log, its kind by the file's ending, a frame each millisecond."""
    with _WRITERS[path.suffix](path) as writer:
        for k, frame in enumerate(frames):
            writer.on_message_received(
                can.Message(
                    timestamp=1_700_000_000 + k * step_s, arbitration_id=frame.id, data=frame.data,
                    is_remote_frame=frame.remote, is_extended_id=False, channel=channel, is_rx=True,
                )
            )  # fmt: skip
    return path


def conversation(counts: Sequence[Sequence[int]], *, device_id: int = 0) -> list[CanFrame]:
    """Return the frames of a hand that was asked who it is, switched on, and reports these encoder counts."""
    frames = [
        allegro_report_frame(_INFO, device_id=device_id),
        allegro_report_frame(AllegroSerial("0123"), device_id=device_id),
        allegro_servo_on(device_id=device_id),
        *(
            allegro_report_frame(AllegroTemperature(finger, (30, 31, None, 33)), device_id=device_id)
            for finger in HAND_FINGERS
        ),
    ]
    for row in counts:
        frames += allegro_position_frames(allegro_angles_rad(row), device_id=device_id)
        frames += allegro_torque_frames(np.array(row) % 100 / 1200, device_id=device_id)
    return frames
