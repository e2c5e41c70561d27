"""The report: from the folder alone, the same bytes each time, every number traced to its events."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("statsmodels")

from reference.command import call
from reference.results import trial_result
from reference.study_bench import files_of
from tega.errors import InvalidValueError, RecordingError
from tega_study.analyse import analyse, analyse_study
from tega_study.coupling import TouchCourse, write_course
from tega_study.difference import PAPER_LABELS
from tega_study.figures import _violins, new_figure
from tega_study.journal import Journal, events_path, read_events
from tega_study.page import number, report_html
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.report import Report, csv_files, write_report
from tega_study.trials import bench_trials, course_path


def fill(folder: Path, *, people: int, courses: bool = True, simulated: bool = True) -> None:
    """Write a study of made-up trials: haptic ones have fewer slips and take a little less time."""
    plan = make_plan(participants=people, seed=3, objects=["bottle", "bag"], trials=3, simulated=simulated)
    write_plan(plan, folder)
    random = np.random.default_rng(8)
    for person in plan.participants:
        with Journal(events_path(folder, person)) as journal:
            journal.add("session_start", t_ns=0, text=plan.settings.plan_sha256)
            t_ns = 0
            for trial in plan.of(person):
                haptic = trial.condition == "haptic"
                journal.add("trial_start", t_ns=t_ns, trial=trial.trial)
                journal.add("lift_off", t_ns=t_ns + 10**9, trial=trial.trial)
                for _ in range(random.poisson(1.5 if haptic else 4.0)):
                    journal.add("slip", t_ns=t_ns + 2 * 10**9, trial=trial.trial)
                t_ns += int(random.normal(14.0 if haptic else 15.0, 0.5) * 1e9)
                good = bool(random.random() < 0.9)
                status: Any = "done" if good else "failed_task"
                journal.add("trial_end", t_ns=t_ns, trial=trial.trial, status=status, success=good)
                if courses:
                    t_s = np.arange(1, 300) / 30
                    pose = np.round(2 + 2 * np.sin(t_s / 2 + random.random()))
                    touch = np.clip(np.convolve(pose, np.ones(6) / 24)[: len(t_s)], 0, 1)
                    write_course(course_path(folder, trial), TouchCourse(t_s, touch, touch**2, pose))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "study"
    fill(folder, people=6)
    return folder


@pytest.fixture(scope="module")
def report(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Report:
    return write_report(study, tmp_path_factory.mktemp("report"))


@pytest.mark.slow
def test_the_folder_alone_gives_the_same_bytes_again(study: Path, report: Report, tmp_path: Path) -> None:
    first = files_of(report.page.parent)
    shutil.copytree(study, tmp_path / "elsewhere")
    assert files_of(write_report(tmp_path / "elsewhere", tmp_path / "b").page.parent) == first
    tables = ("analysis.json", "fig7.svg", "fig8.svg", "fig8.csv")
    assert {"report.html", *(f"report/{name}" for name in tables)} <= set(first)
    assert not list(tmp_path.rglob(".report-*"))


@pytest.mark.slow
def test_what_others_put_beside_a_report_s_tables_is_kept(study: Path, tmp_path: Path) -> None:
    tables = write_report(study, tmp_path).tables
    (tables / "slides").mkdir()
    (tables / "slides" / "talk.txt").write_text("a week of work")
    (tables / "my.csv").write_text("mine")
    (tables / "trials.csv").write_text("stale")
    assert write_report(study, tmp_path).tables == tables
    assert (tables / "slides" / "talk.txt").read_text() == "a week of work"
    assert (tables / "my.csv").read_text() == "mine"
    assert (tables / "trials.csv").read_text() != "stale"
    other, strange = tmp_path / "elsewhere", tmp_path / "strange"
    tables.rename(other)
    tables.symlink_to(other)
    (strange / "report").mkdir(parents=True)
    (strange / "report" / "mine.txt").write_text("keep")
    for out in (tmp_path, strange):
        with pytest.raises(InvalidValueError, match="is no report"):
            write_report(study, out)
    assert (other / "my.csv").exists()
    assert (strange / "report" / "mine.txt").read_text() == "keep"


def test_table_1_is_what_the_events_say_counted_by_hand(study: Path, report: Report) -> None:
    plan = read_plan(study)
    for condition in ("haptic", "non-haptic"):
        slips, times_s, good, n = 0, 0.0, 0, 0
        for person in plan.participants:
            mine = {t.trial for t in plan.of(person) if (t.object, t.condition) == ("bag", condition)}
            events = [event for event in read_events(events_path(study, person)) if event.trial in mine]
            slips += sum(event.kind == "slip" for event in events)
            n += len(mine)
            good += sum(bool(event.success) for event in events)
            times_s += sum({"trial_end": 1, "trial_start": -1}.get(e.kind, 0) * e.t_ns for e in events) / 1e9
        rows = list(csv.reader((report.tables / "table1.csv").read_text().splitlines()))
        column = rows[0].index("bag")
        of = {(row[0], row[1]): row[column] for row in rows[1:]}
        assert of[condition, "Slippage"] == f"{slips / n:.1f}"
        assert of[condition, "Completion Time"] == f"{times_s / n:.1f}"
        assert of[condition, "Success Rate"] == f"{good}/{n}"


def test_every_cell_names_its_trials_and_every_trial_its_events(study: Path, report: Report) -> None:
    analysis = report.analysis
    trials = {trial.id: trial for trial in analysis.trials}
    assert sorted(one for cell in analysis.cells for one in cell.trials) == sorted(trials)
    for cell in analysis.cells:
        mine = [trials[one] for one in cell.trials]
        assert cell.slips == np.mean([trial.slips for trial in mine])
        assert {(trial.object, trial.condition) for trial in mine} == {(cell.object, cell.condition)}
    for trial in trials.values():
        kinds = []
        for event in trial.events:
            path, _, line = event.rpartition(":")
            kinds.append(json.loads((study / path).read_text().splitlines()[int(line) - 1])["kind"])
        assert kinds[0] == "trial_start"
        assert kinds[-1] == "trial_end"
        assert kinds.count("slip") == trial.slips


def test_the_effect_is_found_at_every_level_and_corrected(report: Report) -> None:
    analysis = report.analysis
    slips = {t.level: t for t in analysis.tests if (t.metric, t.object) == ("slips", "bottle")}
    assert set(slips) == {"as printed", "these trials", "people", "adjusted"}
    people: Any = slips["people"]
    assert people.p_holm >= people.p == 2 / 2**6
    assert 0.2 < people.effect < 0.7
    assert (slips["as printed"].effect or 0) < 0
    assert (slips["adjusted"].p or 1) < 0.05
    outside = [t for t in analysis.tests if f"{t.metric}:{t.object}" not in analysis.family]
    assert outside
    assert all(t.p_holm is None for t in outside)


def test_coupling_is_told_beside_what_it_is_without_an_answer(report: Report) -> None:
    analysis = report.analysis
    assert {row.trial for row in analysis.couplings} == {trial.id for trial in analysis.trials}
    for arm in analysis.arms:
        assert (arm.r or 0) > 0.8
        assert arm.positive == 1
        assert (arm.peak_lag_s or 0) > 0  # touch follows the pose: mechanics
        assert arm.r_others is not None
    assert {c.what for c in analysis.contrasts} == {"r", "slope"}
    assert all(sum(use.dwell) == pytest.approx(1) for use in analysis.pose_use)


def test_the_page_needs_nothing_else(report: Report) -> None:
    page = report.page.read_text()
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", page)
    assert "<script" not in page
    assert "Everything here is simulated" in page
    assert page.count("<img ") == page.count('alt="') == 4
    for target in set(re.findall(r'href="#([^"]+)"', page)):
        assert page.count(f'id="{target}"') == 1
    assert str(report.page.parent) not in page
    # On a phone only tables and pictures scroll.
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in page
    for subject in ("<table>", "<img "):
        assert page.count(subject) == page.count(f'<div class="wide">{subject}') > 0
    assert "<caption" not in page, "a note as wide as its table cannot be read on a phone"


@pytest.mark.slow
def test_a_rehearsal_among_people_is_shown_and_cannot_pass_for_data(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    fill(folder, people=2, courses=False, simulated=False)
    assert "no data of people" not in report_html(analyse_study(folder)[0], {})
    with Journal(events_path(folder, "p02")) as journal:
        journal.add("session_start", t_ns=0, text=read_plan(folder).settings.plan_sha256, item="emulated")
    analysis, _ = analyse_study(folder)
    assert analysis.rehearsed == ("p02",)
    message = "the sessions of p02 ran, wholly or in part, on simulated or emulated devices"
    assert f"This is no data of people: {message}" in report_html(analysis, {})


def test_what_a_study_calls_its_parts_is_text_in_the_page(report: Report) -> None:
    named = '<b>"R&D"</b>'
    flow = msgspec.structs.replace(report.analysis.flow, redone={"p01-1": named})
    page = report_html(msgspec.structs.replace(report.analysis, flow=flow, rehearsed=(named,)), {})
    assert named not in page
    assert page.count("&lt;b&gt;&#34;R&amp;D&#34;&lt;/b&gt;") == 2


def test_a_study_without_trials_is_left_alone(tmp_path: Path) -> None:
    write_plan(make_plan(participants=2), tmp_path / "study")
    with pytest.raises(RecordingError, match="no finished trial"):
        write_report(tmp_path / "study")


@pytest.mark.slow
def test_the_verbs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def called(*words: str, code: int = 0) -> str:
        return call(capsys, "study", *words, code=code)[code > 0]

    folder = str(tmp_path / "s")
    words = ("plan", "--participants", "3", "--out", folder, "--anyway")
    assert json.loads(called(*words, "--trials", "2", "--json"))["participants"] == 3
    assert "p03  not begun" in called("status", folder)
    assert "no finished trial" in called("report", folder, code=1)
    assert "p01 has withdrawn" in called("withdraw", folder, "p01", "--yes")
    assert "p01  withdrawn" in called("status", folder)
    assert "2 people under new ids" in called("export", folder, "--out", str(tmp_path / "open"))
    assert "5.9,2.8" in called("power", "--slips", "many", code=2)
    full = str(tmp_path / "full")
    fill(Path(full), people=2, courses=False)
    reported = json.loads(called("report", full, "--json"))
    assert Path(reported["page"]).is_file()
    assert reported["table1"][0] == ["Condition", "Metric", "bottle", "bag"]
    assert "Table I, simulated" in called("report", full)


def opening(page: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", page[page.index("<h1>") : page.index("<h2>")]))


def test_the_page_opens_with_what_was_compared_and_what_came_out(report: Report) -> None:
    message = opening(report.page.read_text())
    compared = "compared haptic with non-haptic in lifting bottle, bag."
    assert f"{compared} 6 simulated people did 72 trials" in message
    for one in report.analysis.outcomes:
        if one.metric == "slips" and one.low is not None and one.high is not None:
            text = f"{one.object} {one.difference:.2f} ({one.low:.2f} to {one.high:.2f})".replace("-", "−")
            assert text in message
    reported = [one for one in report.analysis.outcomes if one.apart]
    assert reported
    for one in reported:
        assert f"{PAPER_LABELS[one.metric].lower()} of {one.object} (less with haptic)" in message
    assert "Nothing here says anything about people" in message


def test_each_further_condition_is_compared_with_the_second_over_people(report: Report) -> None:
    two, title = report.analysis, "<h2>Further conditions</h2>"
    assert not two.further
    assert title not in report.page.read_text()
    # A third condition in which everybody does as in the first, and one slip more.
    more = [
        msgspec.structs.replace(one, id=f"{one.id}-third", condition="event-gated", slips=one.slips + 1)
        for one in two.trials
        if one.condition == "haptic"
    ]
    blind = msgspec.structs.replace(two, conditions=(*two.conditions, "event-gated"), simulated=True)
    three = analyse(blind, [*two.trials, *more], {}, per_cell=3)
    assert three.outcomes == two.outcomes
    assert [one.condition for one in three.further] == ["event-gated"] * len(two.outcomes)
    for first, third in zip(two.outcomes, three.further, strict=True):
        assert (first.metric, first.object) == (third.metric, third.object)
        assert third.difference == pytest.approx((first.difference or 0) + (first.metric == "slips"))
    page = report_html(three, {})
    assert title in page
    assert page.count("<tr><td>event-gated</td><td>bag</td><td>6</td>") == 1
    rows = list(csv.DictReader(csv_files(three, {})["outcomes.csv"].splitlines()))
    assert [row["condition"] for row in rows] == ["haptic"] * 8 + ["event-gated"] * 8


def test_what_two_people_cannot_tell_is_not_given_as_numbers(tmp_path: Path) -> None:
    fill(tmp_path / "study", people=2, courses=False, simulated=False)
    analysis, _ = analyse_study(tmp_path / "study")
    over = [test for test in analysis.tests if test.level == "people"]
    assert all(test.p is None and "no p below 6 people" in test.note for test in over)
    page = report_html(analysis, {})
    message = opening(page)
    assert message.count("interval not estimable") == len(analysis.outcomes)
    assert "None of these differences can be told from chance" in message
    assert "inf" not in " ".join(test.note for test in analysis.tests)
    wide = [test for test in analysis.tests if test.low and test.high and test.effect_name == "ratio"]
    assert all(test.high / test.low <= 1000 for test in wide if test.high and test.low)
    assert "the conditions are equal in any of these outcomes" in message
    ratios = [test for test in over if test.effect is not None]
    assert ratios
    assert all(f"<td>{number(test.effect)} (not estimable)</td>" in page for test in ratios)


def test_the_papers_numbers_stand_beside_ours_with_what_differs(report: Report) -> None:
    page = report.page.read_text()
    assert page.index("What differs from the paper's set-up") > page.index("paper 152.8")
    assert "ten trials for each object and condition" in page
    strange = {"bottle": "cup", "bag": "box"}
    cells = tuple(msgspec.structs.replace(one, object=strange[one.object]) for one in report.analysis.cells)
    objects: dict[str, Any] = {"objects": ("cup", "box"), "cells": cells, "directions": (), "outcomes": ()}
    other = report_html(msgspec.structs.replace(report.analysis, **objects), {})
    assert not any(text in other for text in ("paper 152.8", "set-up"))


def test_simulated_trials_of_other_objects_or_settings_are_not_pooled(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    plain, heavy, hidden = trial_result(), trial_result(mass_kg=0.6), trial_result(view="hidden")
    path.write_bytes(b"\n".join(map(msgspec.json.encode, (plain, heavy))))
    assert [trial.object for trial in bench_trials([path])] == ["bag", "bag_600g"]
    path.write_bytes(b"\n".join(map(msgspec.json.encode, (plain, hidden))))
    with pytest.raises(RecordingError, match="view = direct and hidden"):
        bench_trials([path])


def test_what_rounds_to_nothing_has_no_sign() -> None:
    assert [number(value) for value in (-0.001, 0.0, -0.01, None)] == ["0.00", "0.00", "−0.01", "–"]


@pytest.mark.parametrize(("n", "violins"), [(5, 0), (6, 1)])
def test_few_values_are_dots_without_a_violin(n: int, violins: int) -> None:
    axes = new_figure(2, 2).subplots()
    _violins(axes, [[float(k % 4) for k in range(n)]], ["haptic"])
    assert len(axes.collections) == violins
    assert max(np.size(line.get_xdata()) for line in axes.lines) == n
