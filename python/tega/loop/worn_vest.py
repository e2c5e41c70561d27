"""Open a vest with the rest of its wearer's daily dose: every path that makes a motor vibrate goes through here.

The dose on a person's skin in the last 24 hours, over all runs, and the heat of the motors are kept in a file beside
the calibration (see docs/evidence/safety.md). Times are those of day: between two runs there is no other clock.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated, Final, Self

import msgspec
import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from tega.config import CalibrationConfig, VestConfig
from tega.devices.base import BudgetedVest, RepeatingVest, VestSink
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, DeviceUnavailableError
from tega.runtime.clock import every
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import LOCK_SUFFIX, write_whole
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

    The person's ``file`` is written when the run begins, every five seconds, and when it ends; ``CalibrationError`` if
    it cannot be read. ``may_be`` are the files of the people that an unnamed wearer may be: for each motor the highest
    dose among them is added. ``now_s`` is the time of day.
    """

    def __init__(
        self,
        file: Path,
        budget: MotorBudget,
        *,
        may_be: Sequence[Path] = (),
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._file, self._budget, self._now_s = file, budget, now_s
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
        with suppress(OSError):  # a full disk does not end a run; the last writing reports it
            self.save()


def _of_the_day(file: Path, now_s: float) -> list[_Run]:
    try:
        runs = parse_json(read_foreign(file, most_mib=1, error=CalibrationError), list[_Run])
    except FileNotFoundError:
        return []
    except (OSError, msgspec.MsgspecError) as error:
        raise CalibrationError(
            f"{file.name}: the vibration dose of the last day cannot be read: {error}",
            "delete the file if this person has not worn the vest for a day",
        ) from error
    return [run for run in runs if now_s - run.ended_s < DAY_S]


def _left(runs: Sequence[_Run], now_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    dose_s, heat = np.zeros(40), np.zeros(40)
    for run in runs:
        dose_s += run.dose_s
        # A clock that was set back must not cool anything down.
        cooled = math.exp(-max(0.0, now_s - run.ended_s) / HEAT_TAU_S)
        heat = np.maximum(heat, cooled * np.array(run.heat))
    return dose_s, heat


NAMELESS: Final = "nameless-vest-dose.json"
"""File, in the folder of calibrations, of wearers without a name."""


def dose_file(calibration: CalibrationConfig) -> Path | None:
    """Return the dose file of the settings' person, or the nameless one; ``None`` without a folder."""
    if calibration.person is None:
        return None if calibration.folder is None else calibration.folder / NAMELESS
    from tega.config.person import whose

    person, calibrations = whose(calibration)
    return calibrations.person(person) / "vest-dose.json"


@contextmanager
def _alone(file: Path) -> Iterator[None]:
    """Hold a wearer's dose for this program: two would each count a day of their own, and heat the same motors."""
    file.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(file.with_name(file.name + LOCK_SUFFIX), timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        wearer = "a wearer without a name" if file.name == NAMELESS else file.parent.name
        raise DeviceUnavailableError(
            f"the vest of {wearer} is in use by another program",
            "end that program first; one program at a time may make a vest vibrate",
        ) from error
    try:
        yield
    finally:
        lock.release()


@contextmanager
def worn_vest(section: VestConfig, file: Path | None) -> Iterator[VestSink]:
    """Open the vest of some settings, limited to the rest of its wearer's daily dose.

    Whatever makes a motor vibrate opens the vest here. ``file`` is the wearer's (:func:`dose_file`), ``None`` for one
    with no stored dose. ``DeviceUnavailableError`` also if another program has this wearer's vest open, or may have.
    """
    vest: VestSink = driver_class(str(section.driver), "vest")(section.options)
    if isinstance(vest, RepeatingVest):
        vest.keep_alive_s = section.keep_alive_s
    with ExitStack() as stack:
        if isinstance(vest, BudgetedVest) and file is not None:
            # A person without a name may be any of those who are named, and begins where the one who had most left off.
            may_be = sorted(file.parent.glob("people/*/vest-dose.json")) if file.name == NAMELESS else []
            for own in (file, *may_be):
                stack.enter_context(_alone(own))
            if file.name != NAMELESS:
                with _alone(file.parents[2] / NAMELESS):
                    pass  # a program without a name may have this person's vest
            stack.enter_context(KeptDose(file, vest.budget, may_be=may_be))
        yield stack.enter_context(vest)
