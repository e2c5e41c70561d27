"""What all campaigns share: one runner, one supervisor, one way to report."""

from __future__ import annotations

import json
from itertools import count
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="needs the extra net")

from tega.errors import DeviceUnavailableError
from tega_campaigns.kills import Kill, kill_table
from tega_campaigns.report import put_table, table
from tega_campaigns.runner import CampaignCase, report_cases, run_cases, until
from tega_campaigns.standstill import Standstills
from tega_campaigns.supervisor import SaidLine, Supervisor

KILL = Kill(
    at_s=1.0,
    messages=10,
    ending="EndOfFile",
    lost_s=0.1,
    stood_s=0.0,
    stream_lost_s=0.2,
    recovered=10,
    dropped=0,
    differ=0,
    good=True,
)


@pytest.fixture
def standing() -> Standstills:
    """A machine that stands still all the time."""
    still = Standstills()
    still._found.append((0, 2**62))
    return still


def test_a_case_is_tried_again_while_the_machine_stands_still(standing: Standstills) -> None:
    tries = count(1)
    assert [n for n, _ in run_cases([CampaignCase({}, lambda: next(tries))], standing, attempts=4)] == [4]


def test_a_case_is_run_once_where_the_machine_never_stood_still() -> None:
    tries = count(1)
    cases = [CampaignCase({}, lambda: next(tries))] * 2
    assert list(run_cases(cases, Standstills(), attempts=4)) == [(1, 0), (2, 0)]


def test_of_a_single_attempt_is_told_for_how_long_the_machine_stood_still(standing: Standstills) -> None:
    ((found, still_ns),) = run_cases([CampaignCase({}, lambda: until(lambda: False, 0.01))], standing)
    assert found is None
    assert still_ns >= 10_000_000


def test_an_error_counts_where_the_machine_did_not_stand_still(standing: Standstills) -> None:
    tries = count(1)

    def fails() -> None:
        next(tries)
        raise DeviceUnavailableError("gone", "plug it in")

    for still, n in ((Standstills(), 1), (standing, 4)):
        before = next(tries)
        with pytest.raises(DeviceUnavailableError, match="gone"):
            list(run_cases([CampaignCase({}, fails)], still, attempts=4))
        assert next(tries) - before == n + 1


def test_each_case_is_one_object_of_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert report_cases([CampaignCase({"kill": 3}, lambda: KILL)], as_json=True, attempts=1) == [KILL]
    reported = json.loads(capsys.readouterr().out)
    assert (reported["kill"], reported["good"], reported["lost_s"]) == (3, True, 0.1)
    report_cases([CampaignCase({"kill": 3}, lambda: KILL)], as_json=False, attempts=1)
    assert capsys.readouterr().out.startswith("kill: 3\n  at_s: 1.0\n")


def test_a_table_s_cells_cannot_break_it() -> None:
    assert table(("a", "b"), [("x | y", "")]) == "| a | b |\n|---|---|\n| x \\| y |  |\n"


def test_what_a_station_became_is_told_with_what_it_was_before(tmp_path: Path) -> None:
    with Supervisor(tmp_path / "none.toml") as station:
        reported = [(1.0, "active"), (2.0, "active"), (3.0, "hold"), (4.0, "hold"), (5.0, "idle")]
        station.lines = [SaidLine(at_s, {"state": state, "alerts": []}) for at_s, state in reported]
        station.lines.append(SaidLine(6.0, {"said": "waits for an operator"}))
        assert station.since(2.5, "state") == [(2.5, "active"), (3.0, "hold"), (5.0, "idle")]
        assert station.now["state"] == "idle"
        assert (station.has_said("waits"), station.has_said("leads")) == (6.0, None)
        station.started_s = 5.5
        assert station.now == {}  # of a process that was started anew
        assert not station.well()


def test_a_table_goes_between_the_marks_of_its_name(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- x: begin -->\nold\n<!-- x: end -->\nz\n", encoding="utf-8")
    put_table(page, table(("fault", "seen"), [("cut | slow", "0.10 s")]), name="x")
    wanted = "| fault | seen |\n|---|---|\n| cut \\| slow | 0.10 s |\n"
    assert page.read_text(encoding="utf-8") == f"a\n<!-- x: begin -->\n\n{wanted}\n<!-- x: end -->\nz\n"


def test_the_table_of_kills_has_the_columns_of_the_page() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "recording.md"
    published = page.read_text(encoding="utf-8").split("<!-- kills: begin -->\n\n")[1]
    assert published.splitlines()[:2] == kill_table([KILL]).splitlines()[:2]
    assert published.splitlines()[2].endswith(" | yes |")
