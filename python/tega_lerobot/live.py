"""Observe a running session as the export observes a recording: the same features under the same names."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.devices import driver_class
from tega.errors import ConfigError, DeviceUnavailableError
from tega.hand import JOINT_NAMES
from tega.haptics.motor_layout import find_layout
from tega.loop.program import ProgramSession
from tega.records import HandCommand, Intent, Picture, Record
from tega.records.arm import PoseNumbers
from tega.runtime.opencv import load_cv2
from tega_lerobot.streams import (
    ARM_ACTION,
    ARM_MEASURED,
    ARM_TARGET,
    CLOSURE,
    OBSERVED,
    Column,
    Stream,
    closure_numbers,
    columns_of,
)

FEATURES: Final = ("state", "touch", "touch_si", "emg_levels", "vest", "arm")
"""Features that an observation has where the settings name their devices; ``image_age`` besides, on request."""

# A picture or an intent of before that is the past: the device is lost, and LeRobot has to end.
_STALE_S: Final = 1.0


def emg_channel_count(config: SessionConfig) -> int:
    """Return how many channels the EMG driver announces before it is open; 0 for none, or not yet known."""
    if config.emg is None:
        return 0
    return len(driver_class(config.emg.driver, "emg")(config.emg.options).info.channels)


def feature_names(config: SessionConfig, *, emg_channels: int) -> dict[str, list[str]]:
    """Return the names of the numbers of each feature of a session, before any device is open.

    Features are as the export writes them: ``observation.state`` and so on, and ``action``.
    """
    layout = find_layout(config.vest.layout or DEFAULT_LAYOUT[config.session.preset])
    sizes = {"/hand/frames": len(CLOSURE)}
    if config.tactile or config.vest.driver is not None:  # else the loop makes no frames
        sizes["/vest/frame"] = len(layout.motors)
        if config.hand.driver is not None or config.emg is not None:
            sizes["/hand/joints"] = len(JOINT_NAMES)
    if config.emg is not None:
        sizes["/emg/levels"] = emg_channels + 1
    if config.arm is not None:
        sizes[ARM_MEASURED] = len(PoseNumbers.table)
    streams = {topic: Stream([0], [(0.0,) * n]) for topic, n in sizes.items()}
    for finger in config.tactile:
        streams[f"/tactile/{finger}/contact"] = Stream([0], [(0.0,) * 6])
        streams[f"/tactile/{finger}/image"] = Stream([0], [None])
    return {name: column.names for name, column in columns_of(streams, np.zeros(1, np.int64)).items()}


class _Item(NamedTuple):
    """The newest item of a topic, and when it arrived on the monotonic clock."""

    t_ns: int
    value: Any
    at_s: float


class Live:
    """The newest values of a session, from its bus."""

    def __init__(self, session: ProgramSession) -> None:
        self._session = session
        self._newest: dict[str, _Item] = {}
        self._intent: _Item | None = None
        self._cv2 = load_cv2("lerobot")
        for kind in OBSERVED.keys() - {HandCommand}:
            session.bus.subscribe(kind, self._take, name="lerobot")
        session.bus.subscribe(Picture, self._take_picture, name="lerobot")

    def _take(self, record: Record) -> None:
        value = np.nan_to_num(OBSERVED[type(record)](record)).tolist()  # one that is not known is 0
        if isinstance(record, Intent):
            self._intent = _Item(record.log_ns, record, time.monotonic())
        self._newest[record.where] = _Item(record.log_ns, value, time.monotonic())

    def _take_picture(self, picture: Picture) -> None:
        image = picture.image.copy()  # it is borrowed
        self._newest[picture.where] = _Item(picture.log_ns, image, time.monotonic())

    def columns(self) -> dict[str, Column]:
        """Return the newest numbers as the export's features, each of one frame."""
        newest = self._newest.copy()
        if not newest:
            return {}
        streams = {
            topic: Stream([item.t_ns], [None if topic.endswith("/image") else item.value])
            for topic, item in newest.items()
        }
        now_ns = max(item.t_ns for item in newest.values())
        return columns_of(streams, np.array([now_ns], np.int64))

    def numbers(self, features: Sequence[str]) -> dict[str, float]:
        """Return the newest numbers of some features by name."""
        columns = self.columns()
        return {
            name: float(number)
            for feature in features
            if feature in columns
            for name, number in zip(columns[feature].names, columns[feature].values[0], strict=True)
        }

    def pictures(self, *, height: int, width: int) -> dict[str, NDArray[np.uint8]]:
        """Return the newest picture of each finger, uint8 (height, width, 3) RGB.

        One older than a second raises :class:`DeviceUnavailableError`.
        """
        cv2, pictures = self._cv2, {}
        for topic, item in self._newest.copy().items():
            if topic.endswith("/image"):
                image = _fresh(topic, item)
                if image.shape[:2] != (height, width):
                    image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
                pictures[topic.split("/")[2]] = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
        return pictures

    def closure_numbers(self) -> tuple[float, float]:
        """Return grasp level and closure that the muscles ask for.

        None for a second raises :class:`DeviceUnavailableError`.
        """
        intent: Intent = _fresh(Intent.topic, self._intent)
        return closure_numbers(intent.level, intent.closure)

    def arm_action(self) -> dict[str, float]:
        """Return where the arm's end is to go, by name; where the run has no target for it, its own pose.

        No pose of the arm for a second raises :class:`DeviceUnavailableError`.
        """
        at = _fresh(ARM_MEASURED, self._newest.get(ARM_MEASURED))
        target = self._newest.get(ARM_TARGET)
        if target is not None and time.monotonic() - target.at_s <= _STALE_S:
            at = target.value
        return dict(zip(ARM_ACTION, map(float, at), strict=True))

    def wait(
        self, wanted: Mapping[str, Sequence[str] | None], fingers: Sequence[str], *, patience_s: float
    ) -> None:
        """Wait until the run is active, every feature has a value and every finger a picture.

        A feature that has other numbers than those raises :class:`ConfigError`; something missing after
        ``patience_s``, or a run that has ended, :class:`DeviceUnavailableError`.
        """
        until_s = time.monotonic() + patience_s
        for view in self._session:
            missing = self._missing(wanted, fingers)
            if not missing and view.state == "active":
                return
            if time.monotonic() > until_s:
                raise DeviceUnavailableError(
                    f"the run is {view.state}: {view.reason}; not yet observed: {', '.join(missing) or 'nothing'}",
                    "run tega-teleop doctor",
                )
        raise DeviceUnavailableError("the run has ended before it was active", "run tega-teleop doctor")

    def _missing(self, wanted: Mapping[str, Sequence[str] | None], fingers: Sequence[str]) -> list[str]:
        found = {feature: column.names for feature, column in self.columns().items()}
        levels = "observation.emg_levels"
        if (names := wanted.get(levels)) is not None and len(found.get(levels, names)) != len(names):
            raise ConfigError(
                f"the EMG has {len(found[levels]) - 1} channels, not {len(names) - 1}", "set emg_channels"
            )
        # A feature of several fingers is there when the last one is.
        unlike = [f for f, names in wanted.items() if f not in found or names not in (None, found[f])]
        return unlike + [finger for finger in fingers if f"/tactile/{finger}/image" not in self._newest]


def _fresh(topic: str, item: _Item | None) -> Any:
    """Return the newest value of a topic, unless a program would act on the past."""
    age_s = math.inf if item is None else time.monotonic() - item.at_s
    if item is None or age_s > _STALE_S:
        raise DeviceUnavailableError(f"{topic}: nothing new for {age_s:.1f} s", "run tega-teleop doctor")
    return item.value
