"""Read forearm poses and switches at the operator's station, and put them into commands for the arm."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from tega.devices.registry import driver_class
from tega.devices.tracker.sources.rates import RatePoses
from tega.errors import ConfigError
from tega.records import PoseNumbers
from tega_link.settings import net_of

if TYPE_CHECKING:
    from tega.arm.pose import PoseSource
    from tega.config import SessionConfig
    from tega.loop.inbox.inputs import Inputs, Seat


class ForearmReader:
    """Reads tracker and switches; the tracker is made at once, to know its axes, and opened later.

    Args:
        config: The session's settings.

    Attributes:
        frame: Axes of the poses; ``""`` where nothing leads an arm.

    Raises:
        ConfigError: Something leads an arm, and nothing would stop it at once.
    """

    def __init__(self, config: SessionConfig) -> None:
        net = net_of(config)
        self._source: PoseSource | None = None
        self._seats: dict[str, Seat] = {}
        self._pose: PoseNumbers | None = None
        self.frame = ""
        if net is not None and net.tracker is not None:
            tracker: Any = driver_class(net.tracker.driver, "tracker")(net.tracker.options)
            self._source, self.frame = tracker, tracker.frame
        elif config.input.motion is not None:
            self.frame = RatePoses.frame
        if self.frame and config.input.dead_man is None:
            raise ConfigError(
                "something leads an arm here, but no dead-man switch is set to stop it at once",
                "set [input.dead_man], such as a pedal or a SpaceMouse's button",
            )

    def open(self, stack: ExitStack, inputs: Inputs) -> None:
        """Take note of the switches, and open the tracker; the stack closes it."""
        self._seats = dict(inputs.seats)
        source: Any = self._source
        if source is not None:
            stack.enter_context(source)
        elif (motion := self._seats.get("motion")) is not None:
            self._source = RatePoses(motion.source.state)

    def facts(self, *, may_move: bool) -> dict[str, Any]:
        """Return the fields of a command besides its stamp.

        Args:
            may_move: Whether this station's run is active; without it the dead-man does not count.
        """
        if self._source is not None:
            for pose in self._source.read(time.monotonic_ns()):
                x, y, z = map(float, pose.position_m)
                qx, qy, qz, qw = map(float, pose.quaternion_xyzw)
                self._pose = PoseNumbers(pose.t_ns, (x, y, z), (qx, qy, qz, qw), bool(pose.valid))
        dead_man = self._held("dead_man")
        return {
            "pose": self._pose,
            "dead_man": dead_man and may_move,
            "clutch": self._held("clutch") if "clutch" in self._seats else dead_man,
            # With the dead-man held it means nothing, as on one machine.
            "recover": self._held("recover") and not dead_man,
        }

    def _held(self, name: str) -> bool:
        if (seat := self._seats.get(name)) is None:
            return False
        held = seat.source.state().held
        return bool(held) if seat.button is None else seat.button in held
