"""Compare decoders by the practices that people kept: how far their levels were from the curve, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Literal

import msgspec

from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import PracticeRecord, read_record
from tega_practice.interval import Interval, mean_interval

__all__ = ["TrackingSkill", "compare_tracked", "kept_practices"]


class TrackingSkill(msgspec.Struct, frozen=True, kw_only=True):
    """Error of force tracking with one decoder.

    Attributes:
        decoder: Its name.
        person: Participant ID; ``None``: over people.
        practices: How many.
        unit: Unit of the intervals: ``practices`` of one person, or ``people``.
        rms_error_levels: Root of the mean square of level less curve, mean over the units.
        in_target: Share of the time on the level asked for, mean over the practices.
        difference_levels: Error less that with the first decoder, paired by person; over people alone.
    """

    decoder: str
    person: str | None
    practices: int
    unit: Literal["practices", "people"]
    rms_error_levels: Interval
    in_target: float
    difference_levels: Interval | None = None


def kept_practices(folder: CalibrationFolder, person: str | None = None) -> list[PracticeRecord]:
    """Return the practices of a person, or of everybody, oldest first, those that say their decoder.

    Raises:
        CalibrationError: A file is damaged.
    """
    who = "*" if person is None else folder.person(person).name
    files = sorted(folder.path.glob(f"people/{who}/practice/*.toml"))
    found = (read_record(file, PracticeRecord) for file in files)
    return sorted((record for record in found if record.decoder), key=lambda record: record.made)


def compare_tracked(records: Sequence[PracticeRecord], decoders: Sequence[str] = ()) -> list[TrackingSkill]:
    """Compare decoders: within each person over practices, and over people where there are two or more.

    Args:
        records: Practices.
        decoders: Names of the decoders; the others are compared with the first. None means all, by name.
    """
    names = list(decoders) or sorted({record.decoder for record in records})
    people = sorted({record.person for record in records})
    found, means = [], dict[str, dict[str, float]]()
    for person in people:
        for name in names:
            if mine := [one for one in records if (one.person, one.decoder) == (person, name)]:
                errors = [one.rms_error_levels for one in mine]
                means.setdefault(name, {})[person] = fmean(errors)
                found.append(_skill(name, person, mine, mean_interval(errors)))
    if len(people) > 1:
        first = means.get(names[0], {})
        for name in names:
            if not (values := means.get(name, {})):
                continue
            both = [values[who] - first[who] for who in values if who in first]
            paired = mean_interval(both) if both and name != names[0] else None
            mine = [one for one in records if one.decoder == name]
            found.append(_skill(name, None, mine, mean_interval(list(values.values())), paired))
    return found


def _skill(
    decoder: str,
    person: str | None,
    practices: list[PracticeRecord],
    error: Interval,
    paired: Interval | None = None,
) -> TrackingSkill:
    return TrackingSkill(
        decoder=decoder,
        person=person,
        practices=len(practices),
        unit="people" if person is None else "practices",
        rms_error_levels=error,
        in_target=fmean(one.in_target_percent for one in practices) / 100,
        difference_levels=paired,
    )
