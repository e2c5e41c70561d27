"""Hand, arm, fingertips and vest as a robot of LeRobot, which observes a session and steers hand and arm."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from lerobot.robots import Robot, RobotConfig

from tega.errors import ConfigError
from tega.hand import split_level
from tega_lerobot.live import FEATURES, emg_channel_count, feature_names
from tega_lerobot.plugin.seat import Seated
from tega_lerobot.streams import ARM_ACTION, CLOSURE, closure_numbers

# A shorter quaternion has no direction, and is refused.
_SHORTEST: Final = 0.1


@RobotConfig.register_subclass("tega")
@dataclass(kw_only=True)
class TegaRobotConfig(RobotConfig):
    """Options of the robot.

    Attributes:
        settings: TEGA's settings file.
        sets: Settings to override, such as ``recording.dir="recorded"``.
        person: Person with the calibration to use.
        observe: Features of the export, without ``observation.``, of which LeRobot's state consists.
        emg_channels: Channels of the EMG, where the driver knows them only when it is open.
        height: Height of the observed pictures, pixels.
        width: Width of the observed pictures, pixels.
    """

    settings: Path
    sets: list[str] = field(default_factory=list)
    person: str | None = None
    observe: list[str] = field(default_factory=lambda: list(FEATURES))
    emg_channels: int | None = None
    height: int = 320
    width: int = 240


class TegaRobot(Seated, Robot):
    """Robot ``tega``: an action is a closure, 0 (open) to 1 (closed), and with an arm its end's pose.

    Both pass TEGA's guard and limits. Where the settings name a tracker, the person's forearm leads the arm,
    and the teleoperator of the same session gives its target. An ``observe`` that names a feature that they
    do not have, or an arm that LeRobot would lead without ``arm.mapping.absolute``, raises
    :class:`ConfigError`.
    """

    config_class = TegaRobotConfig
    name = "tega"

    def __init__(self, config: TegaRobotConfig) -> None:
        settings = self._sit(config.settings, config.sets, config.person)
        super().__init__(config)
        self.config = config
        n_channels = emg_channel_count(settings) if config.emg_channels is None else config.emg_channels
        known = feature_names(settings, emg_channels=n_channels)
        allowed = {*FEATURES, "image_age"}
        if unknown := [name for name in config.observe if name not in allowed]:
            raise ConfigError(
                f"observe: no feature {unknown[0]!r}", f"choose from {', '.join(sorted(allowed))}"
            )
        wanted = [f"observation.{name}" for name in config.observe]
        if settings.arm is not None and self._leads_arm and not settings.arm.mapping.absolute:
            raise ConfigError(
                "LeRobot leads the arm to poses, not by motion",
                "set arm.mapping.absolute = true and arm.mapping.frame = 'base', or an arm.tracker",
            )
        self._names = {name: known[name] for name in wanted if name in known}
        self._fingers = list(settings.tactile)
        # LeRobot starts threads for pictures by the number of cameras.
        self.cameras = dict.fromkeys(self._fingers)

    @property
    def observation_features(self) -> dict[str, Any]:
        """Names of the numbers, and shapes of the pictures."""
        numbers = {name: float for names in self._names.values() for name in names}
        shape = (self.config.height, self.config.width, 3)
        return {**numbers, **dict.fromkeys(self._fingers, shape)}

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002, FBT001, FBT002  # LeRobot's signature
        """Begin the session, and wait for a value of everything that is observed."""
        self._begin(self._names, self._fingers)

    def get_observation(self) -> dict[str, Any]:
        """Return the newest numbers, and the newest pictures as uint8 (height, width, 3): red, green, blue."""
        _, live = self._joined
        pictures = live.pictures(height=self.config.height, width=self.config.width)
        return {**live.numbers(list(self._names)), **pictures}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Close the hand to a level, and lead the arm; both lapse after half a second without a new action.

        ``action`` has ``closure``, clipped to 0 (open) to 1 (closed); the grasp level follows from it. With
        an arm it has ``arm_target.x_m`` and so on; its quaternion is brought to unit length. Returns the
        action as it was sent; the arm's part is the run's own target where a tracker leads it. If no
        teleoperator has joined the session then, :class:`ConfigError` is raised; for a number not finite or
        out of range, :class:`InvalidValueError`.
        """
        session, live = self._joined
        level = 1 + 4 * float(np.clip(float(action["closure"]), 0, 1))
        session.hand.level(level)
        sent = dict(zip(CLOSURE, closure_numbers(*split_level(level)), strict=True))
        if self._leads_arm:
            pose = np.array([float(action[name]) for name in ARM_ACTION])
            pose[3:] /= max(float(np.linalg.norm(pose[3:])), _SHORTEST)
            session.arm.pose(pose[:3], pose[3:])
            sent |= dict(zip(ARM_ACTION, pose.tolist(), strict=True))
        elif self._settings.arm is not None:
            if self._run is None or self._run.n_users < 2:
                raise ConfigError(
                    "the settings' tracker leads the arm, not LeRobot",
                    "take out arm.tracker and input.motion, or name a teleoperator of the same settings",
                )
            sent |= live.arm_action()
        return sent
