"""Muscles and forearm as a teleoperator of LeRobot, which gives what they ask of hand and arm."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from tega.errors import ConfigError
from tega_lerobot.plugin.seat import Seated
from tega_lerobot.streams import CLOSURE


@TeleoperatorConfig.register_subclass("tega")
@dataclass(kw_only=True)
class TegaTeleoperatorConfig(TeleoperatorConfig):
    """Options of the teleoperator.

    Attributes:
        settings: TEGA's settings file; where the robot has the same one, both share its session.
        sets: Settings to override.
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
