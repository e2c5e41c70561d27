"""Simulated people do the Fitts test through the real decoders: repeatable, worse where it must be worse."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

pytest.importorskip("sklearn", reason="learned decoders need scikit-learn")
pytest.importorskip("scipy", reason="intervals need SciPy")

from tega.errors import CalibrationError, InvalidValueError, RecordingError
from tega_figures.simulated_skill import skill_figure
from tega_figures.skill_people import compare_people, people_at_test, person_at_test
from tega_figures.skill_simulated import Cursor, Practised, practised, simulated_decoder, simulated_fitts
from tega_sim.operator import typical_person


@pytest.mark.slow
def test_the_same_person_does_the_same_in_any_company() -> None:
    alone = person_at_test(3, ["learned"], ["sweat"], movements=1)
    among = person_at_test(3, ["rules", "learned"], ["none", "sweat"], movements=1)
    assert among.scores["learned"]["sweat"] == alone.scores["learned"]["sweat"]


def carried(gain: float) -> tuple[float, float]:
    """Throughput and completion of a typical person for whom the cursor goes ``gain`` as far as in practice."""
    person = typical_person()
    make, full = simulated_decoder("learned", person, 5)
    known = practised(person, 5, make, full)

    def changed() -> Cursor:
        cursor = make()
        return lambda samples: (gain * cursor(samples)[0], 0.01)

    score = simulated_fitts(person, 5, changed, full, known, movements=2)
    return score.throughput_bits_s, score.completion


@pytest.mark.slow
def test_a_cursor_that_goes_less_far_than_practised_carries_less() -> None:
    as_practised, less = carried(1.0), carried(0.55)
    assert as_practised[0] > less[0]
    assert as_practised[1] >= 0.9


def test_practice_teaches_a_rising_relation() -> None:
    person = typical_person()
    make, full = simulated_decoder("proportional", person, 1)
    known = practised(person, 1, make, full)
    assert (np.diff(known.closure) > 0).all()
    assert 0.1 <= known.settle_s <= 1.0
    assert known.effort_for(0.25) < known.effort_for(0.5) < known.effort_for(0.75)


def test_the_middle_of_a_level_is_aimed_at() -> None:
    effort = np.linspace(0.0, 1.0, 101)
    known = Practised(effort, np.minimum(np.floor(4 * effort), 3) / 4 + 1e-6 * effort, 0.3)
    assert known.effort_for(0.5) == pytest.approx(0.625, abs=0.01)
    line = Practised(effort, effort, 0.3)
    assert line.effort_for(0.4) == pytest.approx(0.4)


@pytest.mark.slow
def test_people_are_compared_in_pairs() -> None:
    decoders, effects = ["rules", "proportional"], ["none", "all"]
    people = people_at_test(range(3), decoders, effects, movements=1)
    rows = compare_people(people, decoders, effects)
    assert [(row.effect, row.decoder, row.people) for row in rows] == [
        ("none", "rules", 3),
        ("none", "proportional", 3),
        ("all", "rules", 3),
        ("all", "proportional", 3),
    ]
    assert rows[0].difference_bits_s is None
    paired = rows[3].difference_bits_s
    assert paired is not None
    assert paired.mean == pytest.approx(rows[3].throughput_bits_s.mean - rows[2].throughput_bits_s.mean)
    lost = rows[3].lost_bits_s
    assert lost is not None
    assert lost.mean == pytest.approx(rows[3].throughput_bits_s.mean - rows[1].throughput_bits_s.mean)
    above, below = skill_figure(rows, 3).axes
    assert "3 simulated people" in above.get_title()
    assert below.get_xlabel() == "effect on the EMG since practice"
    assert [tick.get_text() for tick in below.get_xticklabels()] == ["no effect", "all effects together"]
    assert [axes.get_ylabel() for axes in (above, below)] == ["throughput, bits/s", "movements that hit, %"]


def test_people_are_kept_and_gone_on_with(tmp_path: Path) -> None:
    file, told = tmp_path / "people.jsonl", []

    def progress(_what: str, done: int, total: int) -> None:
        told.append((done, total))

    two = people_at_test([0, 1], ["proportional"], ["none"], movements=1, out=file)
    three = people_at_test([0, 1, 2], ["proportional"], ["none"], movements=1, out=file, progress=progress)
    assert three[:2] == two
    assert told == [(2, 3), (3, 3)]
    with pytest.raises(RecordingError, match="person 0 did other tests"):
        people_at_test([0], ["proportional"], ["none"], movements=2, out=file)
    file.write_bytes(b"nothing\n")
    with pytest.raises(RecordingError, match="holds no simulated people"):
        people_at_test([0], ["proportional"], ["none"], movements=1, out=file)


def test_who_cannot_be_calibrated_is_counted_and_nobody_at_all_is_refused() -> None:
    some = person_at_test(0, ["rules"], ["none"], movements=1)
    without = msgspec.structs.replace(some, person=1, scores={}, refused={"rules": "too weak"})
    (row,) = compare_people([without, some], ["rules"], ["none"])
    assert (row.people, row.refused) == (1, 1)
    with pytest.raises(CalibrationError, match="has no calibrated person: too weak"):
        compare_people([without], ["rules"], ["none"])
    with pytest.raises(InvalidValueError, match="effect 'cold'"):
        person_at_test(0, ["rules"], ["cold"])
