"""Write the frames for a vest into a file instead of a vest."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from tega import records
from tega.devices.base import DeviceInfo, Kind, Options
from tega.errors import DeviceUnavailableError
from tega.records.table import columns, rows
from tega.runtime.files.csv_writer import CsvWriter
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    from tega.haptics import MotorLevels


class VestRecorderOptions(Options, frozen=True):
    """Settings of :class:`VestRecorder`.

    Attributes:
        file: The table to write; it is replaced.
    """

    file: Path


class VestRecorder(Opened):
    """Writes every vest frame as a row: time, then the intensity (0 to 100) of each motor by its API index."""

    kind: ClassVar[Kind] = "vest"
    summary: ClassVar[str] = "writes vest frames to a table instead of a vest"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = VestRecorderOptions

    def __init__(self, options: VestRecorderOptions) -> None:
        self._options = options
        self._is_open = False
        self._csv: CsvWriter | None = None
        self._motors: tuple[int, ...] = ()

    @classmethod
    def harmless(cls, options: VestRecorderOptions) -> None:
        """Do nothing: opening would empty its file."""

    @property
    def info(self) -> DeviceInfo:
        """Name and unit."""
        return DeviceInfo(
            driver="vest-recorder", kind="vest", label=self._options.file.name, live=False, unit="0 to 100"
        )

    def open(self) -> None:
        """Prepare; the file is created with the first frame, which sets the number of motors."""
        self._is_open = True

    def close(self) -> None:
        """Finish the file."""
        self._is_open = False
        if self._csv is not None:
            self._csv.close()
        self._csv = None

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Write one frame down.

        Raises:
            DeviceUnavailableError: The recorder is not open, or the vest changed its motors.
        """
        if not self._is_open:
            raise DeviceUnavailableError(
                f"vest-recorder {self._options.file.name!r} is not open", "open it first"
            )
        motors = tuple(int(m) for m in frame.motors)
        if self._csv is None:
            self._motors = motors
            self._csv = CsvWriter(
                self._options.file, columns(records.VestFrame, intensities=[f"m{m}" for m in motors])
            )
        elif motors != self._motors:
            raise DeviceUnavailableError(
                f"vest-recorder: a frame for {len(motors)} motors after frames for {len(self._motors)}",
                "keep one layout for a whole recording",
            )
        reported = tuple(frame.intensities.tolist())
        self._csv.write(*rows(records.VestFrame(t_ns=t_ns, layout=frame.layout, intensities=reported)))
        return frame
