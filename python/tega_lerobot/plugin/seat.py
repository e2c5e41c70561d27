"""Open one session for a robot and a teleoperator of the same settings, and end it with the last of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.loop.program import ProgramSession, session
from tega_lerobot.live import Live
from tega_lerobot.streams import ARM_ACTION, CLOSURE

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
