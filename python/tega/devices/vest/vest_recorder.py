"""Write the frames for a vest into a file instead of a vest."""

from __future__ import annotations

from typing import ClassVar

from tega import records
from tega.devices.base import Kind
from tega.devices.table_recorder import TableRecorder
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels
from tega.records.table import columns, rows


class VestRecorder(TableRecorder):
    """Writes every vest frame as a row: time, then the intensity (0 to 100) of each motor by its API index."""

    kind: ClassVar[Kind] = "vest"
    name: ClassVar[str] = "vest-recorder"
    unit: ClassVar[str] = "0 to 100"
    summary: ClassVar[str] = "writes vest frames to a table instead of a vest"
    _motors: tuple[int, ...] = ()

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Write one frame down; the first one sets the number of motors, which must not change."""
        motors = tuple(int(m) for m in frame.motors)
        if self._csv is None:
            self._motors = motors
        elif motors != self._motors:
            raise DeviceUnavailableError(
                f"vest-recorder: a frame for {len(motors)} motors after frames for {len(self._motors)}",
                "keep one layout for a whole recording",
            )
        table = self._table(columns(records.VestFrame, intensities=[f"m{m}" for m in motors]))
        reported = tuple(frame.intensities.tolist())
        table.write(*rows(records.VestFrame(t_ns=t_ns, layout=frame.layout, intensities=reported)))
        return frame
