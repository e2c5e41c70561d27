"""Keep the results of a calibration's finished steps, so that an interrupted one goes on after them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from tega.config.calibration.folder import Unfinished
from tega.errors import CalibrationError
from tega.setup.calibration.times import Sitting

_Kept = TypeVar("_Kept")


class Journal:
    """The finished steps of one person's calibration, each written at once."""

    def __init__(self, sitting: Sitting) -> None:
        self._folder, self._person, self._now = sitting.folder, sitting.person, sitting.now
        self._unfinished = Unfinished(started=sitting.now())

    @property
    def done(self) -> tuple[str, ...]:
        """The steps that are finished."""
        return tuple(self._unfinished.steps)

    def begin(self, devices: dict[str, str], *, restart: bool) -> str:
        """Go on with an interrupted calibration, unless ``restart``, or begin anew.

        ``devices`` names each part's device: results of another device are left out. Return a sentence about
        what was done before; ``""`` for a new calibration.
        """
        before = None if restart else self._folder.unfinished(self._person, self._now())
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
        self._folder.forget_unfinished(self._person)

    def _write(self) -> None:
        self._folder.keep_unfinished(self._person, self._unfinished)
