"""Compare decoders by the practices that people kept: how far their levels were from the curve, with intervals."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from statistics import fmean
from typing import Literal

import msgspec

from tega.config.calibration.records import PracticeRecord
from tega_practice.interval import Interval, with_first
from tega_practice.kept import by_person


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


def compare_tracked(records: Sequence[PracticeRecord], decoders: Sequence[str] = ()) -> list[TrackingSkill]:
    """Compare decoders: within each person over practices, and over people where there are two or more.

    Args:
        records: Practices; those of earlier versions, without a decoder, are passed over.
        decoders: Names of the decoders; the others are compared with the first. None means all, by name.
    """
    found = []
    for person, practices in by_person([one for one in records if one.decoder], decoders):
        units: dict[str, dict[Hashable, float]] = {}
        for name, mine in practices.items():
            errors = [(one.person, one.rms_error_levels) for one in mine]
            if person is None:
                people = {who for who, _ in errors}
                units[name] = {
                    one: fmean(error for who, error in errors if who == one) for one in sorted(people)
                }
            else:  # practices of two decoders are no pairs
                units[name] = {(name, k): error for k, (_, error) in enumerate(errors)}
        for name, (error, paired) in with_first(units).items():
            found.append(
                TrackingSkill(
                    decoder=name,
                    person=person,
                    practices=len(practices[name]),
                    unit="people" if person is None else "practices",
                    rms_error_levels=error,
                    in_target=fmean(one.in_target_percent for one in practices[name]) / 100,
                    difference_levels=paired,
                )
            )
    return found
