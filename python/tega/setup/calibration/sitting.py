"""Define what the steps of a calibration share: person and durations, what a fault asks, the results kept so far."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, TypeVar

import msgspec

from tega.config import SessionConfig
from tega.config.calibration.folder import CalibrationFolder
from tega.devices.base import Device
from tega.errors import CalibrationError, RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.runtime.guide import Guide, Undecided


class Times(NamedTuple):
    """Durations of the steps, seconds.

    Attributes:
        presses_s: Without enough presses for so long the person is asked whether to go on.
        get_ready_s: Between a signal and the start of its step.
        pause_s: Between two squeezes: a strong squeeze tires.
        movement_s: One muscle alone.
        pulse_s: One vibration.
        gap_s: Between the two vibrations of a pair.
    """

    baseline_s: float = 1.5
    presses_s: float = 60.0
    get_ready_s: float = 2.0
    rest_s: float = 5.0
    squeeze_s: float = 4.0
    pause_s: float = 30.0
    movement_s: float = 3.0
    pulse_s: float = 0.5
    gap_s: float = 0.3

    def scaled(self, by: float) -> Times:
        """Return the durations times a factor; noise and muscles do not hurry, so baseline and pauses stay."""
        times = Times(*(value * by for value in self))
        return times._replace(
            baseline_s=self.baseline_s, pause_s=self.pause_s, presses_s=max(3.0, times.presses_s)
        )


class Sitting(NamedTuple):
    """One person's calibration with some settings; ``now`` returns the time of day."""

    config: SessionConfig
    person: str
    folder: CalibrationFolder
    guide: Guide
    times: Times
    now: Callable[[], datetime]


_Result = TypeVar("_Result")


def until_good(
    guide: Guide,
    subject: str,
    attempt: Callable[[], _Result],
    problems: Callable[[_Result], Sequence[str]],
    *,
    can_keep: Callable[[_Result], bool] = lambda _result: True,
) -> tuple[_Result, tuple[str, ...]]:
    """Repeat a step until nothing is wrong with it or the person keeps it; return it and the problems kept.

    Raises ``CalibrationError`` if there is a problem and no answer about it, as without a terminal;
    ``KeyboardInterrupt`` if the person gives up.
    """
    while True:
        result = attempt()
        found = tuple(problems(result))
        if not found:
            return result, ()
        for text in found:
            guide.say(text, tone="bad")
        answers = {"a": "again"}
        if can_keep(result):
            answers["k"] = "keep it as it is"
        answers["q"] = "stop here"
        try:
            answer = guide.ask(f"{subject}: what now?", answers)
        except Undecided:
            raise CalibrationError(
                f"{subject}: {'; '.join(found)}", "see to it, then run the same command"
            ) from None
        if answer == "q":
            raise KeyboardInterrupt
        if answer == "k":
            return result, tuple(f"{subject}, kept in spite of: {text}" for text in found)


_Kept = TypeVar("_Kept")


RESUME_H: Final = 4.0
"""An interrupted calibration is gone on with for so long; later the electrodes sit elsewhere."""


class Unfinished(msgspec.Struct, kw_only=True):
    """A calibration that is going on: the results of finished steps by name, and the device of each part.

    Results of one device do not apply to another.
    """

    started: Annotated[datetime, msgspec.Meta(tz=True)]
    devices: dict[str, str] = msgspec.field(default_factory=dict)
    steps: dict[str, Any] = msgspec.field(default_factory=dict)


def unfinished(path: Path, now: datetime) -> Unfinished | None:
    """Return an interrupted calibration that can be gone on with."""
    try:
        found = parse_json(read_foreign(path, most_mib=64), Unfinished)
    except (OSError, RecordingError, msgspec.MsgspecError):
        return None
    return found if timedelta(0) <= now - found.started <= timedelta(hours=RESUME_H) else None


class Journal:
    """The finished steps of one person's calibration, each written at once."""

    def __init__(self, sitting: Sitting) -> None:
        self._path, self._now = sitting.folder.person(sitting.person) / "unfinished.json", sitting.now
        self._unfinished = Unfinished(started=sitting.now())

    @property
    def done(self) -> tuple[str, ...]:
        """The steps that are finished."""
        return tuple(self._unfinished.steps)

    def begin(self, devices: dict[str, str], *, restart: bool) -> str:
        """Go on with an interrupted calibration, unless ``restart``, or begin again.

        ``devices`` names each part's device: results of another device are left out. Return a sentence about
        what was done before; ``""`` for a new calibration.
        """
        before = None if restart else unfinished(self._path, self._now())
        now = self._unfinished = before or self._unfinished
        for part, device in devices.items():
            if now.devices.get(part, device) != device:
                now.steps = {k: v for k, v in now.steps.items() if k != part and not k.startswith(f"{part}.")}
            now.devices[part] = device
        self._write()
        if before is None:
            return ""
        steps = ", ".join(self.done) or "nothing"
        return f"Going on with the calibration begun at {before.started:%H:%M} UTC; done: {steps}"

    def kept(self, name: str, wanted: type[_Kept]) -> _Kept | None:
        """Return the result of a step from before an interruption; ``None`` if it was not done."""
        if name not in self._unfinished.steps:
            return None
        try:
            return msgspec.convert(self._unfinished.steps[name], wanted)
        except msgspec.ValidationError as error:
            raise CalibrationError(
                f"unfinished.json: its entry for the step {name} is damaged: {error}",
                "start again: tega-teleop calibrate --restart",
            ) from error

    def step(self, name: str, wanted: type[_Kept], take: Callable[[], _Kept]) -> _Kept:
        """Return the kept result of a step, or do it and keep its result."""
        kept = self.kept(name, wanted)
        if kept is not None:
            return kept
        result = take()
        self.keep(name, result)
        return result

    def keep(self, name: str, result: Any) -> None:
        """Keep the result of a step."""
        self._unfinished.steps[name] = msgspec.to_builtins(result)
        self._write()

    def forget(self, name: str) -> None:
        """Forget the result of a step."""
        self._unfinished.steps.pop(name, None)
        self._write()

    def end(self) -> None:
        """Delete the journal of a calibration that is finished."""
        self._path.unlink(missing_ok=True)

    def _write(self) -> None:
        text = msgspec.json.format(msgspec.json.encode(self._unfinished)) + b"\n"
        write_whole(self._path, text, sync=True)


def drawing(sitting: Sitting, subject: str) -> str:
    """Return a sentence that names the drawing of the placement, for a person with a known hand."""
    hand = sitting.folder.hand(sitting.person)
    left = "-left" if hand == "left" else ""
    return f" For a {hand} hand: docs/images/placement-{subject}{left}.svg." if hand else ""


def check_live(device: Device) -> None:
    """Refuse a device that generates or replays its signal."""
    if not device.info.live:
        raise CalibrationError(
            f"{device.info.driver}: {device.info.label} generates or replays its signal and cannot be calibrated",
            "name a live device in the settings",
        )
