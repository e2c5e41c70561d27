"""Lead the arm of a session from a program, in the place of a tracker and under the same limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from numpy.typing import ArrayLike

from tega.arm.gate import malformed
from tega.arm.pose import StampedPose
from tega.config import SessionConfig
from tega.devices.base import DeviceInfo
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.clock import Clock
from tega.runtime.lifecycle import Opened
from tega.wire.arrays import float_array

_LONGEST_S: Final = 10.0


class Lapsing:
    """A value that a program sends, for a time of the session's clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._sent: tuple[Any, int] = (None, 0)

    def send(self, value: Any, for_s: float) -> None:
        """Keep a value from now on; it lapses after ``for_s``, above 0 to 10 s."""
        if not 0 < for_s <= _LONGEST_S:
            raise InvalidValueError(f"for_s = {for_s} is out of range: above 0 to {_LONGEST_S:g} s")
        self._sent = value, self._clock.now_ns() + round(for_s * 1e9)

    def now(self) -> Any:
        """Return the value, or ``None`` if none was sent or the last one has lapsed."""
        value, until_ns = self._sent
        return value if value is not None and self._clock.now_ns() < until_ns else None


# A pose that stands is given to the chain again, well before its watchdog misses one.
_AGAIN_NS: Final = 40_000_000


class _ProgramTracker(Opened):
    """Gives the program's newest pose to the arm's chain for as long as it stands."""

    problem = ""

    def __init__(self, sent: Lapsing, frame: str) -> None:
        self.frame, self._sent = frame, sent
        self._given: StampedPose | None = None
        self._given_ns = 0
        self.opened = False

    @property
    def info(self) -> DeviceInfo:
        return DeviceInfo(driver="program", kind="tracker", label="a program", live=True, unit="m")

    def open(self) -> None:
        self.opened = True

    def close(self) -> None:
        self.opened = False

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        pose: StampedPose | None = self._sent.now()
        if pose is None or (pose is self._given and now_ns - self._given_ns < _AGAIN_NS):
            return ()
        self._given, self._given_ns = pose, now_ns
        return (pose._replace(t_ns=now_ns),)


class ProgramArm:
    """Arm of a session, as a program leads it; poses pass the arm's gate, workspace, limits and watchdogs.

    ``tracker`` gives the program's poses to the run; it is ``None`` where the settings name one, or no arm.
    """

    def __init__(self, clock: Clock, config: SessionConfig) -> None:
        self._sent, self._config = Lapsing(clock), config.arm
        self.tracker: _ProgramTracker | None = None
        if config.arm is not None and config.arm.tracker is None and config.input.motion is None:
            self.tracker = _ProgramTracker(self._sent, config.arm.mapping.frame)

    @property
    def led_by_program(self) -> bool:
        """Whether the settings let a program lead the arm: they name one, and neither tracker nor motion input."""
        return self.tracker is not None

    def pose(self, position_m: ArrayLike, quaternion_xyzw: ArrayLike, *, for_s: float = 0.5) -> None:
        """Lead the arm by a pose in the place of the tracker's.

        With ``arm.mapping.absolute`` it is where the arm's end is to go; without, its motion since the operator took
        hold is the arm's. The dead-man switch and the clutch stay the settings' own inputs.

        Args:
            position_m: x, y, z in the axes of ``arm.mapping.frame``, metres.
            quaternion_xyzw: Unit quaternion x, y, z, w.
            for_s: Time after which the pose lapses unless another was sent, above 0 to 10 s. The arm then comes to
                rest, as when a tracker is silent.

        Raises:
            DeviceUnavailableError: The settings name no arm, or something else leads it.
            InvalidValueError: A number is not finite or out of range, or the quaternion has not unit length.
        """
        if self._config is None:
            raise DeviceUnavailableError("the session has no arm", "set arm.driver")
        if self.tracker is None or not self.tracker.opened:
            raise DeviceUnavailableError(
                "something else leads the arm",
                "take out arm.tracker, input.motion and other programs' claims",
            )
        place = float_array("position_m", position_m)
        turn = float_array("quaternion_xyzw", quaternion_xyzw)
        pose = StampedPose(0, place.copy(), turn.copy())
        if why := malformed(pose, self._config.gate):
            raise InvalidValueError(f"pose: {why}", "give x, y, z in metres and a unit quaternion x, y, z, w")
        self._sent.send(pose, for_s)
