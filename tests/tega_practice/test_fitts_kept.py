"""Results of Fitts tests are kept whole, and decoders are compared with intervals."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("scipy", reason="intervals need SciPy")

from reference.command import call
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import read_record
from tega.errors import CalibrationError, TegaError
from tega_learn.logs import PracticeRecord
from tega_practice.fitts import Movement
from tega_practice.kept import (
    FittsRecord,
    compare_kept,
    compare_tracked,
    keep_record,
    kept_records,
    mean_interval,
    movement_row,
)

MADE = datetime(2026, 11, 23, 12, 0, 0, tzinfo=UTC)


def made(person: str, decoder: str, minutes: int) -> dict[str, Any]:
    usual = {"device": "bench", "driver": "ascii-emg", "preset": "live", "seed": 0}
    return {"person": person, "decoder": decoder, "made": MADE + timedelta(minutes=minutes), **usual}


def result(person: str, decoder: str, time_s: float, *, minutes: int = 0) -> FittsRecord:
    movements: list[Movement] = []
    for distance, high, hard in ((0.25, 0.5, 1.0), (0.5, 0.75, 1.5)):
        ends = ((high - 0.04, hard * time_s), (high + 0.04, hard * time_s), (None, 10.0))
        movements += [
            Movement(distance, 0.2, high, high - distance, end or 0.1, end, t, 0.6, 1, inside_at_start=False)
            for end, t in ends
        ]
    return FittsRecord(
        **made(person, decoder, minutes),
        dwell_s=1.0,
        timeout_s=10.0,
        cursor_step=0.01,
        throughput_bits_s=0.0,
        completion_percent=66.7,
        overshoots=0.67,
        movements=tuple(movement_row(one) for one in movements),
    )


def test_a_result_is_kept_whole_and_a_damaged_one_refused(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    with pytest.raises(CalibrationError, match="no Fitts test was kept"):
        compare_kept(kept_records(FittsRecord, folder))
    record = result("p01", "learned", 1.0)
    path = keep_record(record, folder)
    assert path == tmp_path / "people/p01/fitts/20261123-120000.toml"
    assert read_record(path, FittsRecord) == record
    assert read_record(path, FittsRecord).score() == record.score()
    assert record.score().completion == pytest.approx(2 / 3)
    path.write_text(path.read_text(encoding="utf-8").replace("0.25, 0.2,", "0.25,", 1), encoding="utf-8")
    with pytest.raises(TegaError, match="is not 10 numbers"):
        compare_kept(kept_records(FittsRecord, folder))


def test_decoders_are_compared_within_people_and_over_them(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    tests = (("p01", "rules", 2.0), ("p01", "learned", 1.0), ("p02", "rules", 2.6), ("p02", "learned", 1.3))
    for minutes, test in enumerate(tests):
        keep_record(result(*test, minutes=minutes), folder)
    found = compare_kept(kept_records(FittsRecord, folder), ["rules", "learned"])
    units = [("p01", "conditions"), ("p02", "conditions"), (None, "people")]
    rows = [(person, decoder, unit) for person, unit in units for decoder in ("rules", "learned")]
    assert [(one.person, one.decoder, one.unit) for one in found] == rows
    rules, learned = found[-2:]
    difference: Any = learned.difference_bits_s
    assert (rules.difference_bits_s, difference.n) == (None, 2)
    better = learned.throughput_bits_s.mean - rules.throughput_bits_s.mean
    assert difference.mean == pytest.approx(better)
    assert [one.person for one in compare_kept(kept_records(FittsRecord, folder, "p02"))] == ["p02", "p02"]


def practice(person: str, decoder: str, error: float, *, minutes: int) -> PracticeRecord:
    common = made(person, decoder, minutes)
    return PracticeRecord(**common, duration_s=60.0, in_target_percent=50.0, rms_error_levels=error)


def test_practices_are_compared_by_decoder_within_people_and_over_them(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    of_p01 = (("p01", "rules", 1.0), ("p01", "rules", 1.2), ("p01", "learned", 0.5))
    # The last one is of a version that did not say with which decoder.
    of_p02 = (("p02", "rules", 0.9), ("p02", "learned", 0.6), ("p02", "", 3.0))
    for n, one in enumerate(of_p01 + of_p02):
        keep_record(practice(*one, minutes=n), folder)
    found = compare_tracked(kept_records(PracticeRecord, folder), ["rules", "learned"])
    assert [(one.person, one.decoder, one.practices, one.unit) for one in found] == [
        ("p01", "rules", 2, "practices"),
        ("p01", "learned", 1, "practices"),
        ("p02", "rules", 1, "practices"),
        ("p02", "learned", 1, "practices"),
        (None, "rules", 3, "people"),
        (None, "learned", 2, "people"),
    ]
    assert found[0].rms_error_levels.mean == pytest.approx(1.1)
    difference: Any = found[-1].difference_levels
    assert (difference.mean, difference.n) == (pytest.approx((-0.6 - 0.3) / 2), 2)
    alone = compare_tracked(kept_records(PracticeRecord, folder, "p02"))
    assert [one.person for one in alone] == ["p02", "p02"]
    assert compare_tracked([]) == []


def test_the_verb_compares_tests_and_practices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = CalibrationFolder(tmp_path)
    keep_record(practice("p01", "rules", 1.0, minutes=0), folder)
    words = ("emg", "skill", tmp_path)
    reported = json.loads(call(capsys, *words, "--json")[0])
    assert reported["fitts"] == []
    assert reported["tracking"][0]["rms_error_levels"]["mean"] == 1.0
    keep_record(result("p01", "learned", 1.0), folder)
    text, _ = call(capsys, *words)
    assert "Fitts tests" in text
    assert "Practice" in text


def test_an_interval_by_hand() -> None:
    # t with 2 degrees of freedom at 0.975: 4.302653; standard error of 1, 2, 3: 1 / √3.
    found = mean_interval([1.0, 2.0, 3.0])
    assert found.low == pytest.approx(2 - 4.302653 / 3**0.5)
    assert found.high == pytest.approx(2 + 4.302653 / 3**0.5)
    assert mean_interval([2.0]).low is None
