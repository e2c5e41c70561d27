"""Compare decoders on many simulated people at the Fitts test, with and without what changes after a calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import msgspec

from tega.errors import CalibrationError, InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega_figures.skill_simulated import practised, simulated_decoder, simulated_fitts
from tega_practice.fitts import FittsScore
from tega_practice.interval import Interval, mean_interval
from tega_sim.operator import EFFECTS, draw_person, load_parameters
from tega_sim.workers import over_cores

__all__ = ["EFFECT_NAMES", "PeopleSkill", "PersonSkill", "compare_people", "people_at_test", "person_at_test"]

EFFECT_NAMES: Final = ("none", *EFFECTS, "all")
"""Nothing, each effect alone, and all together."""


class PersonSkill(msgspec.Struct, frozen=True, kw_only=True):
    """One simulated person's tests.

    Attributes:
        person: Seed of the person.
        parameters: SHA-256 of the population's parameter file.
        asked: Decoders, effects and movements a condition.
        scores: By decoder, then by effect.
        refused: Decoders that could not be calibrated on this person, with the reason.
    """

    person: int
    parameters: str
    asked: tuple[tuple[str, ...], tuple[str, ...], int]
    scores: dict[str, dict[str, FittsScore]]
    refused: dict[str, str]


class PeopleSkill(msgspec.Struct, frozen=True, kw_only=True):
    """Skill of simulated people with one decoder under one effect.

    Attributes:
        decoder: Its name.
        effect: One of :data:`EFFECT_NAMES`.
        people: How many did the test with it.
        refused: On how many it could not be calibrated.
        throughput_bits_s: Mean over people, with its 95 % interval.
        completion: Share of movements completed, mean over people, with its 95 % interval.
        path_efficiency: Mean over people, with its 95 % interval; ``None`` without any hit.
        overshoots: Overshoots per movement, mean over people, with its 95 % interval.
        difference_bits_s: Throughput less that with the first decoder, person by person; ``None`` for the first.
        lost_bits_s: Throughput less that without an effect, person by person; ``None`` without an effect.
    """

    decoder: str
    effect: str
    people: int
    refused: int
    throughput_bits_s: Interval
    completion: Interval
    path_efficiency: Interval | None
    overshoots: Interval
    difference_bits_s: Interval | None = None
    lost_bits_s: Interval | None = None


def person_at_test(
    seed: int, decoders: Sequence[str], effects: Sequence[str], *, movements: int = 3
) -> PersonSkill:
    """Let one simulated person calibrate each decoder, practise with it, and do the test under each effect.

    Args:
        seed: Seed of the person and of all random draws.
        decoders: As :func:`tega_figures.skill_simulated.simulated_decoder` takes them.
        effects: Names of :data:`EFFECT_NAMES`.
        movements: That count, of each distance and width.

    Raises:
        InvalidValueError: There is no such effect.
        ConfigError: There is no such decoder.
    """
    for name in effects:
        if name not in EFFECT_NAMES:
            raise InvalidValueError(
                f"effect {name!r} is not known", f"choose among {', '.join(EFFECT_NAMES)}"
            )
    person = draw_person(seed)
    scores: dict[str, dict[str, FittsScore]] = {}
    refused = {}
    for decoder in decoders:
        try:
            make, full_effort = simulated_decoder(decoder, person, seed)
        except CalibrationError as error:
            refused[decoder] = error.message
            continue
        known = practised(person, seed, make, full_effort)
        scores[decoder] = {
            effect: simulated_fitts(
                person, seed, make, full_effort, known, _named(effect), movements=movements
            )
            for effect in effects
        }
    return PersonSkill(
        person=seed,
        parameters=load_parameters().digest,
        asked=(tuple(decoders), tuple(effects), movements),
        scores=scores,
        refused=refused,
    )


def _named(effect: str) -> tuple[str, ...]:
    return {"none": (), "all": tuple(EFFECTS)}.get(effect, (effect,))


def people_at_test(
    seeds: Sequence[int],
    decoders: Sequence[str],
    effects: Sequence[str],
    *,
    movements: int = 3,
    workers: int = 1,
    out: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda _what, _done, _total: None,
) -> list[PersonSkill]:
    """Return each simulated person's tests, in the order of the seeds.

    Args:
        seeds: Seeds of the people.
        decoders: Which.
        effects: Which.
        movements: That count, of each distance and width.
        workers: Processes.
        out: A file with a person a line, as JSON. People in it are not simulated again, others are added as they end.
        progress: Called with the number of finished people.

    Raises:
        MissingExtraError: joblib is not installed, and more than one worker is asked for.
        RecordingError: ``out`` holds something else, or people who were asked something else.
    """
    asked = (tuple(decoders), tuple(effects), movements)
    known = {} if out is None else _read(out, asked)
    left = [seed for seed in seeds if seed not in known]
    work = partial(_job, asked=asked)
    progress("people", len(seeds) - len(left), len(seeds))
    for one in over_cores(work, left, workers):
        known[one.person] = one
        if out is not None:
            lines = [msgspec.json.encode(known[person]) + b"\n" for person in sorted(known)]
            write_whole(out, b"".join(lines))
        progress("people", sum(seed in known for seed in seeds), len(seeds))
    return [known[seed] for seed in seeds]


def _read(path: Path, asked: tuple[tuple[str, ...], tuple[str, ...], int]) -> dict[int, PersonSkill]:
    if not path.exists():
        return {}
    try:
        lines = read_foreign(path, most_mib=256).splitlines()
        known = [parse_json(line, PersonSkill) for line in lines]
    except msgspec.DecodeError as error:
        raise RecordingError(f"{path.name}: holds no simulated people: {error}", "name a new file") from error
    today = load_parameters().digest
    for one in known:
        if one.asked != asked or one.parameters != today:
            raise RecordingError(
                f"{path.name}: person {one.person} did other tests, or is of other parameters: {one.asked}",
                "name a new file, or ask for the same decoders, effects and movements",
            )
    return {one.person: one for one in known}


def _job(seed: int, *, asked: tuple[tuple[str, ...], tuple[str, ...], int]) -> PersonSkill:
    decoders, effects, movements = asked
    return person_at_test(seed, decoders, effects, movements=movements)


def compare_people(
    people: Sequence[PersonSkill], decoders: Sequence[str], effects: Sequence[str]
) -> list[PeopleSkill]:
    """Compare decoders over people, effect by effect.

    Args:
        people: Their tests.
        decoders: Names of the decoders; the others are compared with the first.
        effects: Which.

    Raises:
        CalibrationError: A decoder could be calibrated on no person.
    """
    ordered = sorted(people, key=lambda one: one.person)
    return [_row(ordered, decoder, decoders[0], effect) for effect in effects for decoder in decoders]


def _row(people: list[PersonSkill], decoder: str, first: str, effect: str) -> PeopleSkill:
    did = [one for one in people if decoder in one.scores]
    if not did:
        why = next((one.refused[decoder] for one in people if decoder in one.refused), "no person did it")
        raise CalibrationError(f"decoder {decoder!r} has no calibrated person: {why}", "name another decoder")
    mine = [one.scores[decoder][effect] for one in did]
    efficient = [score.path_efficiency for score in mine if score.path_efficiency is not None]
    beside = [one for one in did if first in one.scores]
    return PeopleSkill(
        decoder=decoder,
        effect=effect,
        people=len(did),
        refused=len(people) - len(did),
        throughput_bits_s=mean_interval([score.throughput_bits_s for score in mine]),
        completion=mean_interval([score.completion for score in mine]),
        path_efficiency=mean_interval(efficient) if efficient else None,
        overshoots=mean_interval([score.overshoots for score in mine]),
        difference_bits_s=None
        if decoder == first or not beside
        else mean_interval(
            [
                one.scores[decoder][effect].throughput_bits_s - one.scores[first][effect].throughput_bits_s
                for one in beside
            ]
        ),
        lost_bits_s=None
        if effect == "none" or "none" not in did[0].scores[decoder]
        else mean_interval(
            [
                one.scores[decoder][effect].throughput_bits_s - one.scores[decoder]["none"].throughput_bits_s
                for one in did
            ]
        ),
    )
