"""An interim report has no number and no picture of the full analysis; unblinding is kept in the study's journal."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("statsmodels")

from click.testing import CliRunner
from test_study_report import fill

from reference.study_bench import files_of
from tega.ui.cli.main import cli
from tega_study.analyse import Analysis, analyse_study
from tega_study.journal import events_path
from tega_study.page import number, report_html
from tega_study.privacy import export
from tega_study.report import write_report
from tega_study.tables import csv_files

NUMBER = r"[−-]?\d+\.\d+(?:e-?\d+)?"


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a study of three people with a real difference; the last has one trial left."""
    folder = tmp_path_factory.mktemp("made") / "study"
    fill(folder, people=3)
    path = events_path(folder, "p03")
    lines = path.read_bytes().splitlines(keepends=True)
    last = json.loads(lines[-1])["trial"]
    path.write_bytes(b"".join(line for line in lines if json.loads(line).get("trial") != last))
    return folder


@pytest.fixture
def study(unfinished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(unfinished, tmp_path / "study"))


def _numbers(value: object) -> Iterator[float]:
    """Return every number that is not whole: whole ones also count trials and people."""
    if isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _numbers(one)
    elif isinstance(value, float) and value != round(value):
        yield value
    elif isinstance(value, str):  # a note, such as "Boschloo p = 0.0123"
        yield from (float(found) for found in re.findall(r"\d+\.\d{2,}", value))


def _results(analysis: Analysis) -> dict[str, object]:
    """Return what a full analysis has beyond the facts that an interim one states."""
    full: dict[str, object] = json.loads(msgspec.json.encode(analysis))
    for stated in ("flow", "alpha", "assumptions", "parameters", "object_facts", "source", "version"):
        del full[stated]
    return full


def test_no_number_of_the_full_analysis_is_in_an_interim_report(study: Path, tmp_path: Path) -> None:
    written = write_report(study, tmp_path / "early")
    assert written.analysis.blind
    early = files_of(tmp_path / "early")
    text = b"\n".join(early.values()).decode()
    assert "Results are withheld" in text
    assert not [name for name in early if name.endswith(".svg")]
    assert "<img" not in text
    full, (courses, _pictures) = analyse_study(study, unblind=True)
    numbers = sorted(set(_numbers(_results(full))))
    assert len(numbers) > 500
    displayed = {text_of for value in numbers for text_of in (repr(value), f"{value:.6g}", f"{value:.3g}")}
    displayed |= {number(value, digits) for value in numbers for digits in (2, 3)}
    # "0.05" is the level, "0.2 m" the height, "0.0625" and the like stand in the methods' text.
    fill(tmp_path / "other", people=2, courses=False)
    events_path(tmp_path / "other", "p02").unlink()
    write_report(tmp_path / "other", tmp_path / "stated")
    static = set(re.findall(NUMBER, b"\n".join(files_of(tmp_path / "stated").values()).decode()))
    assert not set(re.findall(NUMBER, text)) & displayed - static
    for metric in ("slips", "duration_s", "rank-biserial", "ratio"):
        assert f'"{metric}":' not in text
    # The same text with the numbers would be found: the check can fail.
    whole = report_html(full, {}) + "".join(csv_files(full, courses).values())
    assert displayed & set(re.findall(NUMBER, whole))


def test_unblinding_is_kept_and_reported_for_ever(study: Path, tmp_path: Path) -> None:
    early, _ = analyse_study(study)
    assert (early.blind, early.tests, early.trials, early.unblinded) == (True, (), (), ())
    requested, material = analyse_study(study, unblind=True)
    assert not requested.blind
    assert requested.tests
    assert material.courses
    (message,) = requested.unblinded
    assert re.fullmatch(r"\d{4}-\d\d-\d\d: 2 of 3 people complete", message)
    shutil.rmtree(study / "sessions" / "p03")
    (study / "withdrawn.txt").write_text("p03\n")
    complete, _ = analyse_study(study)
    assert not complete.interim
    assert complete.unblinded == (message,)
    assert f"before the plan was complete: {message}" in report_html(complete, {})
    export(study, tmp_path / "open", key="secret")
    shutil.rmtree(tmp_path / "open" / "sessions" / "p02")  # blind again, and quick
    assert analyse_study(tmp_path / "open")[0].unblinded == ("2 of 3 people complete",)


def test_the_verb_withholds_results_unless_told(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tega_study.report.figures_of", lambda *_: {})

    def printed(*words: str) -> str:
        return CliRunner().invoke(cli, ["study", "report", str(study), *words]).stdout

    displayed = printed()
    assert "2 people complete; results are withheld" in displayed
    assert "Table I" not in displayed
    reported = json.loads(printed("--json"))
    assert (reported["blind"], reported["table1"], reported["tests"]) == (True, [], [])
    assert "Table I" in printed("--unblind")
