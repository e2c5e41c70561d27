"""LeRobot's robot and teleoperator ``tega``; importing this registers both, and needs the package ``lerobot``.

The robot is hand, arm, fingertips and vest, and observes a session; the teleoperator gives what muscles and forearm
ask for. Both share one session where their settings are the same, which ends with the last of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from lerobot.robots import Robot, RobotConfig
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.hand import split_level
from tega.loop.program import ProgramSession, session
from tega_lerobot.live import FEATURES, Live, emg_channel_count, feature_names
from tega_lerobot.streams import ARM_ACTION, CLOSURE, closure_numbers

# A shorter quaternion has no direction, and is refused.
_SHORTEST: Final = 0.1
PATIENCE_S: Final = 60.0
"""How long a device of LeRobot waits for its first values."""


class _Run:
    """A session that runs, and its number of users."""

    def __init__(self, key: tuple[Any, ...], run: ProgramSession) -> None:
        if run.config.session.pace != "real":
            raise ConfigError("LeRobot runs in real time", 'set session.pace = "real"')
        self.key, self.session, self.n_users = key, run, 0
        self.live = Live(run)


_RUNS: dict[tuple[Any, ...], _Run] = {}


class Seated:
    """What robot and teleoperator have in common: a place in a session, and TEGA's own calibration and settings."""

    _run: _Run | None = None

    def _sit(self, settings: Path, sets: list[str], person: str | None) -> SessionConfig:
        """Name the session by its settings, which are returned; ``person`` of ``None`` is the one whom they name."""
        self._key = (settings.resolve(), tuple(sets), person)
        self._make = partial(session, settings, sets=tuple(sets), person=person)
        made = self._make()
        self._settings, self._leads_arm = made.config, made.arm.led_by_program
        return made.config

    @property
    def action_features(self) -> dict[str, Any]:
        """The closure, the grasp level nearest to it, and with an arm the pose where its end is to go."""
        return dict.fromkeys((*CLOSURE, *(() if self._settings.arm is None else ARM_ACTION)), float)

    @property
    def is_connected(self) -> bool:
        """Whether it is connected."""
        return self._run is not None

    @property
    def is_calibrated(self) -> bool:
        """Whether it is calibrated; the settings name the calibration."""
        return True

    def calibrate(self) -> None:
        """Do nothing: ``tega-teleop calibrate`` calibrates."""

    def configure(self) -> None:
        """Do nothing: the settings file configures."""

    def disconnect(self) -> None:
        """End the session, unless another device still uses it: the vest gets zeros, and the hand is let go."""
        run, self._run = self._run, None
        if run is None:
            return
        run.n_users -= 1
        if run.n_users == 0 or run.session.over:
            if _RUNS.get(run.key) is run:
                del _RUNS[run.key]
            run.session.__exit__(None, None, None)

    def _begin(self, wanted: Mapping[str, Sequence[str] | None], fingers: Sequence[str]) -> None:
        """Join the session of these settings, or begin it, and wait for its first values."""
        if self.is_connected:
            raise DeviceAlreadyConnectedError("tega is connected")
        run = _RUNS.get(self._key)
        if run is None or run.session.over:
            run = _Run(self._key, self._make())
            run.session.__enter__()
            _RUNS[self._key] = run
        run.n_users += 1
        self._run = run
        try:
            _, live = self._joined
            live.wait(wanted, fingers, patience_s=PATIENCE_S)
        except BaseException:
            self.disconnect()
            raise

    @property
    def _joined(self) -> tuple[ProgramSession, Live]:
        """The session and its newest values.

        A run that has ended raises :class:`DeviceNotConnectedError`, or the error with which it ended.
        """
        if self._run is None:
            raise DeviceNotConnectedError("tega is not connected")
        if self._run.session.over:
            ended = self._run.session.summary.get("ended", "")
            self.disconnect()
            raise DeviceNotConnectedError(f"the run of TEGA has ended: {ended}")
        return self._run.session, self._run.live


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
        width: Width of the observed pictures, pixels; ``height`` likewise.
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


@TeleoperatorConfig.register_subclass("tega")
@dataclass(kw_only=True)
class TegaTeleoperatorConfig(TeleoperatorConfig):
    """Options of the teleoperator.

    Attributes:
        settings: TEGA's settings file; where the robot has the same one, both share its session.
        person: Person with the calibration to use.
    """

    settings: Path
    sets: list[str] = field(default_factory=list)
    person: str | None = None


class TegaTeleoperator(Seated, Teleoperator):
    """Teleoperator ``tega``; settings without EMG raise :class:`ConfigError`."""

    config_class = TegaTeleoperatorConfig
    name = "tega"

    def __init__(self, config: TegaTeleoperatorConfig) -> None:
        if self._sit(config.settings, config.sets, config.person).emg is None:
            raise ConfigError(f"{config.settings}: a teleoperator needs muscles", "set emg.driver")
        super().__init__(config)
        self.config = config

    @property
    def feedback_features(self) -> dict[str, Any]:
        """None: the session shows touch on the vest by itself."""
        return {}

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002, FBT001, FBT002  # LeRobot's signature
        """Begin the session, and wait for the first intent, and with an arm for its pose."""
        wanted = ["observation.emg_levels"] + ["observation.arm"] * (self._settings.arm is not None)
        self._begin(dict.fromkeys(wanted), ())

    def get_action(self) -> dict[str, Any]:
        """Return the closure that the muscles ask for now, the nearest grasp level, and the arm's target.

        If there was none for a second, :class:`DeviceUnavailableError` is raised.
        """
        _, live = self._joined
        closure = dict(zip(CLOSURE, live.closure_numbers(), strict=True))
        return closure if self._settings.arm is None else closure | live.arm_action()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: the session shows touch on the vest by itself."""
