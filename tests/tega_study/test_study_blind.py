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

from tega.ui.cli.main import cli
from tega_study.analyse import Analysis, analyse_study
from tega_study.journal import events_path
from tega_study.page import number
from tega_study.privacy import export
from tega_study.report import write_report


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a study of seven people with a real difference; the last has one trial left."""
    folder = tmp_path_factory.mktemp("made") / "study"
    fill(folder, people=7)
    path = events_path(folder, "p07")
    lines = path.read_bytes().splitlines(keepends=True)
    last = json.loads(lines[-1])["trial"]
    path.write_bytes(b"".join(line for line in lines if json.loads(line).get("trial") != last))
    return folder


def _copy(study: Path, folder: Path) -> Path:
    shutil.copytree(study, folder / "study")
    return folder / "study"


def _numbers(value: object) -> Iterator[float]:
    """Return every number that is not whole: whole ones also count trials and people."""
    if isinstance(value, dict):
        for one in value.values():
            yield from _numbers(one)
    elif isinstance(value, list):
        for one in value:
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


def _written(folder: Path) -> str:
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*")) if path.is_file())


def test_no_number_of_the_full_analysis_is_in_an_interim_report(unfinished: Path, tmp_path: Path) -> None:
    study = _copy(unfinished, tmp_path)
    written = write_report(study, tmp_path / "early")
    assert written.analysis.blind
    text = _written(tmp_path / "early")
    assert "Results are withheld" in text
    assert not list((tmp_path / "early").rglob("*.svg"))
    assert "<img" not in text
    full, _ = analyse_study(study, unblind=True)
    numbers = sorted(set(_numbers(_results(full))))
    assert len(numbers) > 500
    displayed = {text_of for value in numbers for text_of in (repr(value), f"{value:.6g}", f"{value:.3g}")}
    displayed |= {number(value, digits) for value in numbers for digits in (2, 3)}
    in_report = set(re.findall(r"[−-]?\d+\.\d+(?:e-?\d+)?", text))
    # "0.05" is the level, "0.2 m" the height, "0.0625" and the like stand in the methods' text.
    write_report(_other(tmp_path), tmp_path / "other")
    static = set(re.findall(r"[−-]?\d+\.\d+", _written(tmp_path / "other")))
    assert not (in_report & displayed) - static
    for metric in ("slips", "duration_s", "rank-biserial", "ratio"):
        assert f'"{metric}":' not in text
    # The same text with the numbers would be found: the check can fail.
    write_report(study, tmp_path / "full", unblind=True)
    assert displayed & set(re.findall(r"[−-]?\d+\.\d+(?:e-?\d+)?", _written(tmp_path / "full")))


def _other(folder: Path) -> Path:
    """Return an unfinished study without any event of slip: its interim report has no number of the first one's."""
    fill(folder / "other-study", people=2, courses=False)
    path = events_path(folder / "other-study", "p02")
    path.write_bytes(path.read_bytes().splitlines(keepends=True)[0])
    return folder / "other-study"


def test_unblinding_is_kept_and_reported_for_ever(unfinished: Path, tmp_path: Path) -> None:
    study = _copy(unfinished, tmp_path)
    early, _ = analyse_study(study)
    assert (early.blind, early.tests, early.trials, early.unblinded) == (True, (), (), ())
    requested, material = analyse_study(study, unblind=True)
    assert not requested.blind
    assert requested.tests
    assert material.courses
    (message,) = requested.unblinded
    assert re.fullmatch(r"\d{4}-\d\d-\d\d: 6 of 7 people complete", message)
    shutil.rmtree(study / "sessions" / "p07")
    (study / "withdrawn.txt").write_text("p07\n")
    complete = write_report(study)
    assert not complete.analysis.interim
    assert complete.analysis.unblinded == (message,)
    assert f"before the plan was complete: {message}" in complete.page.read_text()
    export(study, tmp_path / "open", key="secret")
    assert analyse_study(tmp_path / "open")[0].unblinded == ("6 of 7 people complete",)


def test_the_verb_withholds_results_unless_told(unfinished: Path, tmp_path: Path) -> None:
    study = str(_copy(unfinished, tmp_path))
    displayed = CliRunner().invoke(cli, ["study", "report", study])
    assert "6 people complete; results are withheld" in displayed.stdout
    assert "Table I" not in displayed.stdout
    reported = json.loads(CliRunner().invoke(cli, ["study", "report", study, "--json"]).stdout)
    assert (reported["blind"], reported["table1"], reported["tests"]) == (True, [], [])
    displayed = CliRunner().invoke(cli, ["study", "report", study, "--unblind"])
    assert "Table I" in displayed.stdout
