"""Keep the results of Fitts tests and of vest tests, one file each, and compare decoders with intervals."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator, Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import ClassVar, Final, Literal, NamedTuple, TypeVar

import msgspec

from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import CalibrationRecord, read_record, write_record
from tega.errors import CalibrationError
from tega.runtime.lifecycle import scipy_stats
from tega_learn.logs import PracticeRecord
from tega_practice.fitts import FittsScore, Movement, fitts_score


class Interval(msgspec.Struct, frozen=True, kw_only=True):
    """Mean over ``n`` units with its 95 % interval.

    The ends are ``None`` with one unit, which says nothing of how units differ.
    """

    mean: float
    low: float | None = None
    high: float | None = None
    n: int

    def __str__(self) -> str:
        """Return the mean and the ends, such as ``1.20 [1.05, 1.35]``."""
        ends = "" if self.low is None or self.high is None else f" [{self.low:.2f}, {self.high:.2f}]"
        return f"{self.mean:.2f}{ends}"


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of some values, one at least, with its interval by t, n - 1 degrees of freedom.

    Raises ``MissingExtraError`` without SciPy.
    """
    if len(values) == 1:
        return Interval(mean=values[0], n=1)
    mean = fmean(values)
    reach = float(scipy_stats().t.ppf(0.975, len(values) - 1)) * stdev(values) / len(values) ** 0.5
    return Interval(mean=mean, low=mean - reach, high=mean + reach, n=len(values))


_Kept = TypeVar("_Kept", bound=CalibrationRecord)

_NONE: Final = -1.0


class FittsRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-fitts"):
    """Result of a Fitts test: the headline, and every movement, from which all figures can be had again.

    Attributes:
        preset: Rules of the levels.
        decoder: Name of the decoder; with the rules, the preset's too.
        options: Its options, as JSON.
        seed: Seed of the conditions' order.
        dwell_s: So long the cursor had to stay.
        timeout_s: After so long the next target came.
        cursor_step: Closure between neighbouring places of the cursor.
        completion_percent: Movements that hit.
        path_efficiency_percent: Path efficiency of the hits; left out without any.
        movements: A row a movement: distance, width, centre, start, entry, end-point (-1: none), time_s,
            path, overshoots, 1 where it began inside its target.
    """

    comments: ClassVar[dict[str, str]] = {
        "throughput_bits_s": "ISO 9241-411, on closure; mean over distances and widths",
        "overshoots": "a movement",
        "movements": "distance, width, centre, start, entry, end (-1: none), time_s, path, overshoots, began inside",
    }

    person: str
    preset: Literal["paper", "live"]
    decoder: str
    options: str = ""
    seed: int
    dwell_s: float
    timeout_s: float
    cursor_step: float
    throughput_bits_s: float
    completion_percent: float
    path_efficiency_percent: float | None = None
    overshoots: float
    movements: tuple[tuple[float, ...], ...]

    def score(self) -> FittsScore:
        """Return the figures of the movements; a row of no movement raises :class:`CalibrationError`."""
        return fitts_score([_moved(row) for row in self.movements], cursor_step=self.cursor_step)


_Decoded = TypeVar("_Decoded", FittsRecord, PracticeRecord)


def movement_row(one: Movement) -> tuple[float, ...]:
    """Return a movement as a row of numbers."""
    return tuple(float(_NONE if value is None else value) for value in one)


def _moved(row: tuple[float, ...]) -> Movement:
    if len(row) != len(Movement._fields) or not all(map(math.isfinite, row)):
        raise CalibrationError(f"movement {row} is not {len(Movement._fields)} numbers", "do the test again")
    distance, width, centre, start, entry, endpoint, time_s, path, overshoots, inside = row
    places, ends = (distance, width, centre, start, entry), None if endpoint < 0 else endpoint
    return Movement(*places, ends, time_s, path, int(overshoots), inside_at_start=bool(inside))


class AspectScore(NamedTuple):
    """Answers to one kind of question: ``right`` is their share, 0 to 1, ``chance`` that of guessing."""

    aspect: str
    asked: int
    right: float
    chance: float


class VestSkillRecord(
    CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-vest-skill"
):
    """Result of a test of the vest, and of the staircase before it.

    Attributes:
        options: The mapping's options, as JSON.
        right_percent: Right answers of the test.
        chance_percent: What guessing gives.
        difference_percent: Difference of firmness that is perceived in 71 % of pairs, of the maximum; left
            out if the staircase did not settle, or was not run.
        dose_s: What lesson and test used of the day of the most driven motor, seconds of full drive.
        answers: A row a question of the test: aspect, shown cue, answer, number of choices.
    """

    comments: ClassVar[dict[str, str]] = {
        "right_percent": "of the test's questions",
        "difference_percent": "of the maximum, noticed in 71 % of pairs",
        "dose_s": "seconds of full drive, of the most driven motor",
        "answers": "about what, shown, said, answers to choose from",
    }

    person: str
    mapping: str
    options: str = ""
    seed: int
    right_percent: float
    chance_percent: float
    difference_percent: float | None = None
    dose_s: float
    answers: tuple[tuple[str, str, str, int], ...]

    def scores(self) -> list[AspectScore]:
        """Return the score of each aspect, in the order of their first questions."""
        aspects = dict.fromkeys(row[0] for row in self.answers)
        found = []
        for aspect in aspects:
            rows = [row for row in self.answers if row[0] == aspect]
            right = fmean(displayed == text for _, displayed, text, _ in rows)
            found.append(AspectScore(aspect, len(rows), right, fmean(1 / max(row[3], 1) for row in rows)))
        return found


def keep_record(record: FittsRecord | PracticeRecord | VestSkillRecord, folder: CalibrationFolder) -> Path:
    """Write a result into the person's folder; return the file."""
    name = f"{record.made:%Y%m%d-%H%M%S}.toml"
    path = folder.person(record.person) / _place(type(record)) / name
    write_record(record, path)
    return path


def kept_records(kind: type[_Kept], folder: CalibrationFolder, person: str | None = None) -> list[_Kept]:
    """Return the results of a person, or of everybody, oldest first."""
    who = "*" if person is None else folder.person(person).name
    files = sorted(folder.path.glob(f"people/{who}/{_place(kind)}/*.toml"))
    return sorted((read_record(file, kind) for file in files), key=lambda record: record.made)


def _place(kind: type[CalibrationRecord]) -> str:
    return str(kind.__struct_config__.tag).removeprefix("tega-")


class DecoderSkill(msgspec.Struct, frozen=True, kw_only=True):
    """Skill with one decoder, beside that with the first one named.

    Attributes:
        person: Participant ID; ``None``: over people.
        unit: Unit of the intervals: ``conditions`` of one person, or ``people``.
        completion: Share of movements, mean over the tests.
        path_efficiency: Mean over the tests; ``None`` without a hit.
        overshoots: A movement, mean over the tests.
        difference_bits_s: Throughput less that of the first decoder, paired by unit; ``None`` for the first.
    """

    decoder: str
    person: str | None
    tests: int
    unit: Literal["conditions", "people"]
    throughput_bits_s: Interval
    completion: float
    path_efficiency: float | None
    overshoots: float
    difference_bits_s: Interval | None = None


def compare_kept(records: Sequence[FittsRecord], decoders: Sequence[str] = ()) -> list[DecoderSkill]:
    """Compare decoders: within each person over the conditions, and over people where there are two or more.

    The decoders named are compared with the first of them; none named means all, by name. No result raises
    :class:`CalibrationError`.
    """
    if not records:
        raise CalibrationError("no Fitts test was kept", "tega-teleop emg fitts SETTINGS.toml --person ID")

    def values(person: str | None, record: FittsRecord) -> list[tuple[Hashable, float]]:
        score = record.score()
        if person is None:
            return [(record.person, score.throughput_bits_s)]
        return [((one.distance, one.width), one.throughput_bits_s) for one in score.conditions]

    found = []
    for person, name, tests, throughput, difference in _compared(records, decoders, values):
        mine = [one.score() for one in tests]
        efficient = [one.path_efficiency for one in mine if one.path_efficiency is not None]
        found.append(
            DecoderSkill(
                decoder=name,
                person=person,
                tests=len(mine),
                unit="people" if person is None else "conditions",
                throughput_bits_s=throughput,
                completion=fmean(one.completion for one in mine),
                path_efficiency=fmean(efficient) if efficient else None,
                overshoots=fmean(one.overshoots for one in mine),
                difference_bits_s=difference,
            )
        )
    return found


def _compared(
    records: Sequence[_Decoded],
    decoders: Sequence[str],
    values: Callable[[str | None, _Decoded], list[tuple[Hashable, float]]],
) -> Iterator[tuple[str | None, str, list[_Decoded], Interval, Interval | None]]:
    """Yield for each person and, of two or more, for all (``None``), each decoder with records.

    Beside the records come the mean over their units, whose ``values`` each record has some of, and the
    difference from the first decoder over the units of both: ``None`` for the first, and without common ones.
    """
    names = list(dict.fromkeys(decoders)) or sorted({record.decoder for record in records})
    people: list[str] = sorted({record.person for record in records})
    for person in [*people, None] if len(people) > 1 else people:
        reference: dict[Hashable, float] = {}
        for name in names:
            mine = [one for one in records if person in {None, one.person} and one.decoder == name]
            units: defaultdict[Hashable, list[float]] = defaultdict(list)
            for one in mine:
                for unit, value in values(person, one):
                    units[unit].append(value)
            means = {unit: fmean(some) for unit, some in units.items()}
            both = [value - reference[unit] for unit, value in means.items() if unit in reference]
            if means:
                difference = mean_interval(both) if both else None
                yield person, name, mine, mean_interval(list(means.values())), difference
            if name == names[0]:
                reference = means


class TrackingSkill(msgspec.Struct, frozen=True, kw_only=True):
    """Error of force tracking with one decoder.

    Attributes:
        person: Participant ID; ``None``: over people.
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

    Records of earlier versions, without a decoder, are passed over. The decoders named are compared with the
    first of them; none named means all, by name.
    """

    def values(person: str | None, record: PracticeRecord) -> list[tuple[Hashable, float]]:
        # Practices of two decoders are no pairs.
        unit = record.person if person is None else (record.decoder, record.made)
        return [(unit, record.rms_error_levels)]

    return [
        TrackingSkill(
            decoder=name,
            person=person,
            practices=len(practices),
            unit="people" if person is None else "practices",
            rms_error_levels=error,
            in_target=fmean(one.in_target_percent for one in practices) / 100,
            difference_levels=paired,
        )
        for person, name, practices, error, paired in _compared(
            [one for one in records if one.decoder], decoders, values
        )
    ]
