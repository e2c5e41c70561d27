"""Open a vest with the rest of its wearer's daily dose: every path that makes a motor vibrate goes through here."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from filelock import FileLock, Timeout

from tega.config import CalibrationConfig, VestConfig
from tega.devices.base import BudgetedVest, RepeatingVest, VestSink
from tega.devices.registry import driver_class
from tega.errors import DeviceUnavailableError
from tega.runtime.files.whole_file import LOCK_SUFFIX
from tega.safety.dose_file import KeptDose

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

    Whatever makes a motor vibrate opens the vest here: a run, a played one, a study, calibration,
    ``identify``, the measurement of a motor's onset. ``file`` is the wearer's (:func:`dose_file`), ``None``
    for one with no stored dose; a driver is set in ``section``. ``DeviceUnavailableError`` also if another
    program has this wearer's vest open, or may have.
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
