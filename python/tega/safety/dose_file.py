"""Keep the vest's dose on a person's skin in the last 24 hours, over all runs, in a file beside the calibration.

The dose is a day's (see docs/evidence/safety.md), so a second run of the day begins where the first one ended. The heat
of the motors is kept with it and cools down meanwhile, or a quick restart would give a hot motor another half a minute
of full drive. Times are the machine's time of day: between two runs there is no other clock.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Final, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import CalibrationError
from tega.runtime.clock import every
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.safety.motor_budget import HEAT_TAU_S, MotorBudget

DAY_S: Final = 86_400.0
"""So long a run counts, from its end on."""

SAVE_S: Final = 5.0
"""Time between saves, the largest loss if the process is killed."""


# JSON has no number that is not finite, and a negative one would give a day more than there is.
_AtLeast0 = Annotated[float, msgspec.Meta(ge=0)]
_Each = Annotated[tuple[_AtLeast0, ...], msgspec.Meta(min_length=40, max_length=40)]


class _Run(msgspec.Struct):
    """One run's part: when it ended (seconds, time of day), its own dose, and how warm it left the motors."""

    ended_s: _AtLeast0
    dose_s: _Each
    heat: _Each


class KeptDose:
    """Loads a vest's dose from earlier runs into its budget, and stores the dose of this run.

    The person's ``file`` is written when the run begins, every five seconds, and when it ends;
    ``CalibrationError`` if it cannot be read. ``budget`` is the vest's, before its first frame. ``may_be``
    are the files of the people that an unnamed wearer may be: for each motor the highest dose among them is
    added. ``now_s`` is the time of day.
    """

    def __init__(
        self,
        file: Path,
        budget: MotorBudget,
        *,
        may_be: Sequence[Path] = (),
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._file = file
        self._budget = budget
        self._now_s = now_s
        began_s = now_s()
        self._before = _of_the_day(file, began_s)
        self._carried_s, heat = _left(self._before, began_s)
        others = [_left(_of_the_day(other, began_s), began_s) for other in may_be]
        if others:
            self._carried_s = self._carried_s + np.max([dose_s for dose_s, _ in others], axis=0)
            heat = np.maximum(heat, np.max([warm for _, warm in others], axis=0))
        budget.carry(dose_s=self._carried_s, heat=heat)
        self._saving = ExitStack()

    def save(self) -> None:
        """Write the file."""
        used_s = np.maximum(self._budget.dose_s - self._carried_s, 0.0)
        now = _Run(self._now_s(), tuple(used_s.tolist()), tuple(self._budget.heat.tolist()))
        runs = [*self._before, now] if used_s.any() else self._before
        write_whole(self._file, msgspec.json.encode(runs) + b"\n", sync=True)

    def __enter__(self) -> Self:
        """Begin to keep it."""
        self.save()
        self._saving.enter_context(every(self._save_again, every_s=SAVE_S))
        return self

    def __exit__(self, *_error: object) -> None:
        """Keep it a last time."""
        self._saving.close()
        self.save()

    def _save_again(self) -> None:
        with suppress(OSError):  # a full disk does not end a run; the last writing tells it
            self.save()


def _of_the_day(file: Path, now_s: float) -> list[_Run]:
    return [run for run in _read(file) if now_s - run.ended_s < DAY_S]


def _left(runs: Sequence[_Run], now_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the dose of some runs, seconds, and the heat that is left of them."""
    dose_s, heat = np.zeros(40), np.zeros(40)
    for run in runs:
        dose_s += run.dose_s
        # A clock that was set back must not cool anything down.
        cooled = math.exp(-max(0.0, now_s - run.ended_s) / HEAT_TAU_S)
        heat = np.maximum(heat, cooled * np.array(run.heat))
    return dose_s, heat


def _read(file: Path) -> list[_Run]:
    try:
        return parse_json(read_foreign(file, most_mib=1, error=CalibrationError), list[_Run])
    except FileNotFoundError:
        return []
    except (OSError, msgspec.MsgspecError) as error:
        raise CalibrationError(
            f"{file.name}: the vibration dose of the last day cannot be read: {error}",
            "delete the file if this person has not worn the vest for a day",
        ) from error
