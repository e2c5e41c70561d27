"""Keep a person's test scores with the vest, one for each test, by person and mapping."""

from __future__ import annotations

from statistics import fmean
from typing import ClassVar, NamedTuple

from tega.config.calibration.records import CalibrationRecord
from tega.errors import CalibrationError


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
        """Return the score of each aspect, in the order of their first questions; there must be an answer."""
        if not self.answers:
            raise CalibrationError("the record has no answer", "do the test again")
        aspects = dict.fromkeys(row[0] for row in self.answers)
        found = []
        for aspect in aspects:
            rows = [row for row in self.answers if row[0] == aspect]
            right = fmean(displayed == text for _, displayed, text, _ in rows)
            found.append(AspectScore(aspect, len(rows), right, fmean(1 / max(row[3], 1) for row in rows)))
        return found
