"""The simulated hand on a CAN bus: it answers and reports as an Allegro Hand v4 does.

The bus is python-can's virtual one (or ``vcan``), so the code that will steer a real hand can be run against the
simulated world unchanged. Simulated: temperatures are constant, the inertial unit is silent, no frame is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.errors import DeviceUnavailableError, MissingExtraError
from tega.runtime.lifecycle import Opened
from tega.wire import (
    HAND_FINGERS,
    AllegroInfo,
    AllegroPeriod,
    AllegroRejected,
    AllegroRequest,
    AllegroSerial,
    AllegroServo,
    AllegroTemperature,
    AllegroTorque,
    CanFrame,
    allegro_decode,
    allegro_position_frames,
    allegro_report_frame,
    allegro_requested,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["AllegroOnBus"]

_COUNTS_PER_TORQUE: Final = 1200
_JOINT_C: Final = (36, 36, 36, 36)
_PALM_C: Final = 45
# The longest angle an encoder can report; the joints' stops lie well inside.
_ANGLE_MAX_RAD: Final = 2.9


class AllegroOnBus(Opened):
    """Plays a version 4 right hand on a bus.

    It obeys SERVO ON and OFF, SET TORQUE and SET PERIOD, answers requests, and sends its joint positions and
    temperatures at the periods asked for. As with the real hand, nothing is sent before a period is set, there is
    no torque while the servo is off, and the last torque stays when the host falls silent.

    Use: call :meth:`tick` whenever the host has sent its frames, then apply :attr:`torques` for the next cycle.

    Args:
        channel: Name of the virtual bus.
        interface: python-can's name of the adapter: ``virtual``, or ``socketcan`` with a ``vcan`` channel.
        device_id: The hand's number on its bus, 0 to 3.

    Attributes:
        rejected: How many frames were not understood.
    """

    def __init__(self, *, channel: str = "tega", interface: str = "virtual", device_id: int = 0) -> None:
        """Store the settings; nothing is opened yet."""
        self._channel, self._interface, self._device_id = channel, interface, device_id
        self._bus: Any = None
        self._can: Any = None
        self._counts = np.zeros(16)
        self._servo_on = False
        self._position_ms = self._temperature_ms = 0
        self._next_position_s = self._next_temperature_s = 0.0
        self.rejected = 0

    def open(self) -> None:
        """Join the bus.

        Raises:
            MissingExtraError: python-can is not installed.
            DeviceUnavailableError: There is no such bus.
        """
        try:
            import can
        except ImportError as error:
            raise MissingExtraError("the hand's bus needs python-can", "pip install 'tega[sim]'") from error
        self.close()
        self._can = can
        try:
            self._bus = can.Bus(interface=self._interface, channel=self._channel)
        except (can.CanError, OSError, ValueError, NotImplementedError) as error:
            raise DeviceUnavailableError(
                f"bus {self._interface}:{self._channel} did not open: {error}",
                "interface 'virtual' needs no hardware",
            ) from error

    def close(self) -> None:
        """Leave the bus."""
        if self._bus is not None:
            self._bus.shutdown()
        self._bus = None

    @property
    def torques(self) -> NDArray[np.float64]:
        """Torques now, float64 (16,), in torque units; zeros while the servo is off."""
        return self._counts / _COUNTS_PER_TORQUE if self._servo_on else np.zeros(16)

    @property
    def servo_on(self) -> bool:
        """Whether the motors are on."""
        return self._servo_on

    def tick(self, t_s: float, angles_rad: NDArray[np.float64]) -> None:
        """Take the frames that have come, answer them, and send the reports that are due.

        Args:
            t_s: Simulated time, seconds; never less than at the last call.
            angles_rad: Joint angles now, float64 (16,).

        Raises:
            DeviceUnavailableError: The bus is not open.
        """
        if self._bus is None:
            raise DeviceUnavailableError("the hand is not on its bus", "open it first")
        angles = np.clip(angles_rad, -_ANGLE_MAX_RAD, _ANGLE_MAX_RAD)
        while (message := self._bus.recv(timeout=0)) is not None:
            self._take(message, t_s, angles)
        # Half a microsecond: sums of cycles are not exact.
        if self._position_ms and t_s >= self._next_position_s - 5e-7:
            self._next_position_s += 1e-3 * self._position_ms
            self._send(allegro_position_frames(angles, device_id=self._device_id))
        if self._temperature_ms and t_s >= self._next_temperature_s - 5e-7:
            self._next_temperature_s += 1e-3 * self._temperature_ms
            self._send([self._report(AllegroTemperature(finger, _JOINT_C)) for finger in HAND_FINGERS])

    def _take(self, message: Any, t_s: float, angles: NDArray[np.float64]) -> None:
        frame = CanFrame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
        request = allegro_requested(frame, device_id=self._device_id)
        if request is not None:
            self._answer(request, angles)
            return
        text = allegro_decode(
            frame, device_id=self._device_id, extended=message.is_extended_id, error=message.is_error_frame
        )
        match text:
            case AllegroServo(on):
                self._servo_on = on
            case AllegroTorque(finger, counts):
                first = 4 * HAND_FINGERS.index(finger)
                self._counts[first : first + 4] = counts
            case AllegroPeriod(position_ms, _, temperature_ms, _):
                self._position_ms, self._temperature_ms = position_ms, temperature_ms
                self._next_position_s = self._next_temperature_s = t_s
            case AllegroRejected():
                self.rejected += 1
            case _:
                # Other hands' reports, and what version 4 firmware ignores.
                pass

    def _answer(self, request: AllegroRequest, angles: NDArray[np.float64]) -> None:
        finger = request.finger or "index"
        match request.wants:
            case "info":
                self._send([self._report(AllegroInfo((4, 2), (4, 6), "right", _PALM_C, int(self._servo_on)))])
            case "serial":
                self._send([self._report(AllegroSerial("SIM0000R"))])
            case "position":
                self._send(
                    [allegro_position_frames(angles, device_id=self._device_id)[HAND_FINGERS.index(finger)]]
                )
            case "temperature":
                self._send([self._report(AllegroTemperature(finger, _JOINT_C))])
            case "imu":
                pass

    def _report(self, report: AllegroInfo | AllegroSerial | AllegroTemperature) -> CanFrame:
        return allegro_report_frame(report, device_id=self._device_id)

    def _send(self, frames: list[CanFrame]) -> None:
        for frame in frames:
            self._bus.send(
                self._can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False, is_fd=False)
            )
