"""What a report says of simulated people; and what an interim one withholds: every number and picture."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("statsmodels")

import msgspec
import numpy as np
from msgspec.structs import replace
from test_study_report import fill

from reference.command import call
from reference.study_bench import counted, files_of, ran
from tega_study.analyse import Analysis, analyse_study
from tega_study.difference import directions
from tega_study.journal import Journal, events_path
from tega_study.page import _ranges, number, report_html
from tega_study.plan import PlannedTrial, StudyPlan, read_plan
from tega_study.privacy import export
from tega_study.report import csv_files, write_report
from tega_study.silico.sensitivity import ARMS, SENSITIVITY, read_sensitivity
from tega_study.silico.simulate import made_study
from tega_study.touch_picture import picture_path, read_touch_picture, write_touch_picture

SHA = "101a8f666f21c0758534eb3afb6042942ec306f22020a4590ac3539a7a26006f"
OBJECTS = ("bottle", "container", "bag")


def happened(folder: Path, plan: StudyPlan, slips: Callable[[PlannedTrial], int]) -> None:
    def happen(journal: Journal, trial: PlannedTrial, at_ns: int) -> None:
        journal.add("lift_off", t_ns=at_ns + 10**9, trial=trial.trial)
        for _ in range(slips(trial)):
            journal.add("slip", t_ns=at_ns + 2 * 10**9, trial=trial.trial)

    for person in plan.participants:
        ran(folder, person, happen)


def few_with_touch(trial: PlannedTrial) -> int:
    """Fewer slips with touch, by 1 to 3, but more with the container."""
    less = 1 + int(trial.participant[1:]) % 3
    return 4 - less * (trial.condition != "non-haptic") * (-1 if trial.object == "container" else 1)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of six people with changes of one parameter and an arm, and a picture."""
    folder = tmp_path_factory.mktemp("silico") / "s"
    plan, _ = made_study(
        folder, operators=6, seed=1, objects=OBJECTS, conditions=("haptic", "non-haptic"), trials=2
    )
    happened(folder, plan, few_with_touch)
    random = np.random.default_rng(1)
    baseline = random.integers(90, 100, (320, 240, 3), dtype=np.uint8)
    frame = baseline.copy()
    y, x = np.ogrid[:320, :240]
    frame[(y - 150) ** 2 + (x - 120) ** 2 < 40**2] += 60
    path = picture_path(folder, plan.trials[0])
    path.parent.mkdir(parents=True)
    # As an earlier version wrote it, without what the loop measured.
    maxima = np.array([0.0, 9e4])
    np.savez_compressed(
        path, finger=np.array("thumb"), preset=np.array("live"), baseline=baseline, frame=frame, maxima=maxima
    )
    for name, everyone, first in (
        ("base", {}, "haptic"),
        ("vest.weber-low", {"vest.weber": 0.12}, "haptic"),
        ("vest.weber-high", {"vest.weber": 0.65}, "haptic"),
        ("arm-constant", {}, "constant"),
    ):
        small, _ = made_study(
            folder / SENSITIVITY / name, operators=3, seed=1, objects=OBJECTS, conditions=(first, "non-haptic"),
            trials=1, everyone=everyone,
        )  # fmt: skip
        slips = few_with_touch if name in {"base", "vest.weber-low"} else lambda _trial: 4
        happened(folder / SENSITIVITY / name, small, slips)
    return folder


def test_a_direction_is_people_s_mean_difference_with_its_t_interval() -> None:
    counts = [("p01", "haptic", 1), ("p01", "haptic", 2), ("p01", "non-haptic", 5)]
    counts += [("p02", "haptic", 1), ("p02", "non-haptic", 3), ("p03", "haptic", 9)]
    trials = [counted(*one, object="bottle") for one in counts]
    of = {(one.metric, one.object): one for one in directions(trials, ("haptic", "non-haptic"))}
    slips = of["slips", "bottle"]
    assert (slips.people, slips.first, slips.second, slips.difference) == (2, 1.25, 4.0, -2.75)
    # Differences -3.5 and -2, so sd 1.5/sqrt(2); t(0.975, 1) = tan(0.475 pi).
    reach = math.tan(0.475 * math.pi) * 0.75
    assert slips.low == pytest.approx(-2.75 - reach)
    assert slips.high == pytest.approx(-2.75 + reach)
    assert slips.verdict == "not distinguished"
    assert of["duration_s", "bottle"].low is None, "people all alike give no interval"
    assert of["slips", "bag"].verdict == "no data"
    assert len(of) == 9
    signs = {key: one.paper_sign for key, one in of.items()}
    assert signs["duration_s", "container"] == signs["success", "bottle"] == 1
    assert signs["deformations", "bag"] == -1


def test_the_page_says_what_came_out_and_of_which_assumptions(study: Path) -> None:
    done = write_report(study)
    page = done.page.read_text(encoding="utf-8")
    verdicts = {(one.metric, one.object): one.verdict for one in done.analysis.directions}
    assert verdicts["slips", "bottle"] == verdicts["slips", "bag"] == "as printed"
    assert verdicts["slips", "container"] == "opposite"
    assert verdicts["success", "bottle"] == "not distinguished"
    assert (
        "2 of the paper's 9 differences come out in its direction (slippage of bottle, slippage of bag)"
        in page
    )
    assert "1 comes out the other way (slippage of container)" in page
    assert SHA in page
    assert "committed, before the first closed-loop run" in page
    assert "Fig 3" in page
    with (done.tables / "provenance.csv").open(encoding="utf-8", newline="") as file:
        rows = dict(csv.reader(file))
    assert rows["parameters_sha256"] == SHA
    assert rows["parameters"] == "frozen before the first run"
    assert rows["simulated"] == "1"
    for name in ("trials.csv", "table1.csv", "directions.csv", "sensitivity.csv", "fig3.csv"):
        assert rows[name] == hashlib.sha256((done.tables / name).read_bytes()).hexdigest()


@pytest.mark.slow
def test_the_sensitivity_table_says_where_a_direction_turns(study: Path) -> None:
    rows = read_sensitivity(study)
    changed = [
        ("vest.weber", "0.12 share", "low"),
        ("vest.weber", "0.65 share", "high"),
        ("arm", "constant", ""),
    ]
    assert [(row.what, row.setting, row.end) for row in rows] == [("base", "", ""), *changed]
    assert "constant" in ARMS
    assert all(row.people == 3 and row.trials == 18 for row in rows)
    page = write_report(study).page.read_text(encoding="utf-8")
    turns = page[page.index("turns within the range of") :]
    assert turns.index("Slippage, bottle") < turns.index("vest.weber (at 0.65 share)")
    (study / SENSITIVITY / "base" / "sessions" / "p02" / "events.jsonl").rename(study / "kept")
    rows = read_sensitivity(study)
    assert [row.what for row in rows] == ["vest.weber", "vest.weber", "arm"]
    assert {ends for *_, ends in _ranges(rows)} == {"–"}, "nothing to turn against"
    (study / "kept").rename(study / SENSITIVITY / "base" / "sessions" / "p02" / "events.jsonl")


def test_a_picture_is_read_as_it_was_written_with_what_the_loop_measured(study: Path, tmp_path: Path) -> None:
    old = read_touch_picture(picture_path(study, read_plan(study).trials[0]))
    assert old.touch.contact.in_contact
    assert old.touch.map is not None
    assert np.count_nonzero(old.touch.map.mask) == old.touch.contact.eda
    moved = old._replace(touch=old.touch._replace(contact=replace(old.touch.contact, eda=7, cci=0.5)))
    for n, written in enumerate((moved, moved._replace(touch=moved.touch._replace(map=None)))):
        write_touch_picture(tmp_path / f"{n}.npz", written)
        again = read_touch_picture(tmp_path / f"{n}.npz")
        kept = ("finger", "mass", "centroid_xy", "spread", "threshold", "eda", "cci", "peak", "peak_xy")
        for name in kept:  # as it was, not as it would be measured now
            assert getattr(again.touch.contact, name) == getattr(written.touch.contact, name), name
        assert (again.touch.map is None) == (written.touch.map is None)


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
def interim(unfinished: Path, tmp_path: Path) -> Path:
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


def test_no_number_of_the_full_analysis_is_in_an_interim_report(interim: Path, tmp_path: Path) -> None:
    written = write_report(interim, tmp_path / "early")
    assert written.analysis.blind
    early = files_of(tmp_path / "early")
    text = b"\n".join(early.values()).decode()
    assert "Results are withheld" in text
    assert not [name for name in early if name.endswith(".svg")]
    assert "<img" not in text
    full, (courses, _pictures) = analyse_study(interim, unblind=True)
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


def test_unblinding_is_kept_and_reported_for_ever(interim: Path, tmp_path: Path) -> None:
    early, _ = analyse_study(interim)
    assert (early.blind, early.tests, early.trials, early.unblinded) == (True, (), (), ())
    requested, material = analyse_study(interim, unblind=True)
    assert not requested.blind
    assert requested.tests
    assert material.courses
    (message,) = requested.unblinded
    assert re.fullmatch(r"\d{4}-\d\d-\d\d: 2 of 3 people complete", message)
    shutil.rmtree(interim / "sessions" / "p03")
    (interim / "withdrawn.txt").write_text("p03\n")
    complete, _ = analyse_study(interim)
    assert not complete.interim
    assert complete.unblinded == (message,)
    assert f"before the plan was complete: {message}" in report_html(complete, {})
    export(interim, tmp_path / "open", key="secret")
    shutil.rmtree(tmp_path / "open" / "sessions" / "p02")  # blind again, and quick
    assert analyse_study(tmp_path / "open")[0].unblinded == ("2 of 3 people complete",)


def test_the_verb_withholds_results_unless_told(
    interim: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tega_study.report.figures_of", lambda *_: {})

    def printed(*words: str) -> str:
        return call(capsys, "study", "report", interim, *words)[0]

    displayed = printed()
    assert "2 people complete; results are withheld" in displayed
    assert "Table I" not in displayed
    reported = json.loads(printed("--json"))
    assert (reported["blind"], reported["table1"], reported["tests"]) == (True, [], [])
    assert "Table I" in printed("--unblind")
