"""Campaigns: a short soak, its verdict, what it finds missing in recordings made by hand, runner and supervisor."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from itertools import count
from pathlib import Path

import pytest

from reference.command import call
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.records import ArmTarget, Joints, Record, Skip
from tega_campaigns.runner import CampaignCase, run_cases
from tega_campaigns.soak.lost import KeptCounts, check
from tega_campaigns.soak.plan import KINDS, plan
from tega_campaigns.soak.report import SoakFault, SoakReport
from tega_campaigns.soak.trial import soak
from tega_campaigns.standstill import Standstills
from tega_campaigns.supervisor import SaidLine, Supervisor


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="emulated devices need pseudo-terminals, limits Linux")
def test_a_short_soak_passes(capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads(call(capsys, "soak", "--seconds", 60, "--seed", 1, "--patient", "--json")[0])
    assert report["passed"]
    assert {"kill -9", "disk full"} <= {fault["kind"] for fault in report["faults"]}
    for fault in report["faults"]:
        assert (
            fault["injected_s"] <= fault["detected_s"] <= fault["recovered_s"]
            or "not judged" in fault["outcome"]
        )
    assert report["over_limit_commands"] == 0
    assert report["commands"]["hand"] > 1000
    assert report["commands"]["arm"] > 100
    assert report["lost_s"] <= 0.5
    assert report["rss_mib_end"] > 10


@pytest.mark.slow
@pytest.mark.parametrize(("how", "device"), [("stop", "program"), ("pause", "index")])
def test_a_soak_of_one_fault_passes(tmp_path: Path, how: str, device: str) -> None:
    kinds = [kind for kind in KINDS if (kind.how, kind.device) == (how, device)]
    assert not soak(tmp_path, seconds=12.0, seed=1, kinds=kinds, patient=True).failures


def test_a_plan_has_every_fault_once_before_any_comes_again() -> None:
    faults = [each.fault for each in plan(5)]
    assert plan(5) == plan(5) != plan(6)
    assert set(faults[: len(KINDS)]) == set(KINDS)
    assert {fault.how for fault in faults[:2]} == {"kill", "disk"}
    for each in plan(5):
        assert each.fault.lasts_s[0] <= each.lasts_s <= each.fault.lasts_s[1]


def good() -> SoakReport:
    fault = SoakFault(kind="unplug", device="emg", how="unplug", injected_s=1.0, outcome="recovered")
    return SoakReport(
        faults=[fault] * 20,
        rss_mib_start=100.0,
        rss_mib_end=101.0,
        lost_s=0.2,
        commands={"vest": 10, "hand": 10, "arm": 10},
        recordings=1,
    )


def unjudged(n: int, how: str = "unplug") -> list[SoakFault]:
    text = "not judged: the machine stood still for 0.3 s"
    return [SoakFault(kind="unplug", device="emg", how=how, injected_s=1.0, outcome=text)] * n


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("over_limit", {"hand": 1}, "above a limit"),
        ("lost_s", 0.51, "recording are lost"),
        ("rss_mib_end", 130.0, "memory grew"),
        ("faults", [], "too short"),
        ("faults", unjudged(20), "0 of 20 faults could be judged"),
        ("faults", good().faults + unjudged(2), "20 of 22 faults could be judged"),
        ("faults", good().faults + unjudged(1, "freeze 1"), "was never judged"),
        ("commands", {}, "the vest was commanded nothing"),
        ("commands", {"vest": 10, "hand": 0, "arm": 10}, "the hand was commanded nothing"),
        ("commands", {"vest": 10, "hand": 10}, "the arm was commanded nothing"),
        ("recordings", 0, "nothing was recorded"),
        ("rss_mib_end", 0.0, "memory was not measured"),
        (
            "faults",
            [SoakFault(kind="a", device="b", how="c", injected_s=0.0, outcome="not reported")],
            "not reported",
        ),
    ],
)
def test_each_thing_that_is_wrong_alone_fails_a_soak(name: str, value: object, word: str) -> None:
    report = good()
    report.judge()
    assert report.passed
    setattr(report, name, value)
    report.judge()
    assert not report.passed
    assert word in report.failures[0]


_MS = 1_000_000


def recorded(folder: Path, records: Sequence[Record]) -> KeptCounts:
    tree = {"recording": {"dir": str(folder / "session"), "stop_free_mib": 0.0}}
    settings = check_tree(tree, {}, base=folder).config.recording
    recorder = McapRecorder(SessionFolder(folder / "session"), settings)
    recorder.head({}, {})
    recorder.begin(0, 1_000_000_000_000_000_000)
    for record in records:
        recorder.put(record)
    recorder.finish()
    return check(recorder.path)


def ticks(*at_ms: int) -> list[Record]:
    return [Skip(t_ns=ms * _MS) for ms in at_ms]


def target(at_ms: int, x_m: float) -> ArmTarget:
    t_ns, there = at_ms * _MS, {"position": (x_m, 0.0, 0.3), "quaternion": (0.0, 0.0, 0.0, 1.0)}
    return ArmTarget(t_ns=t_ns, taken_ns=t_ns, frame="arm_base", **there)


def test_a_gap_in_the_loop_s_ticks_is_one_though_other_records_go_on(tmp_path: Path) -> None:
    between = [Joints(t_ns=ms * _MS, angles_rad=(0.0,) * 16) for ms in range(100, 800, 30)]
    kept = recorded(tmp_path, [*ticks(0, 33, 66), *between, *ticks(800, 833)])
    assert [till - since for since, till in kept.gaps] == [734 * _MS]
    assert not kept.cut


def test_ticks_without_a_gap_have_none_whatever_else_is_late(tmp_path: Path) -> None:
    late = [Joints(t_ns=-2_000 * _MS, angles_rad=(0.0,) * 16)]
    assert recorded(tmp_path, [*ticks(0, 33), *late, *ticks(66, 99)]).gaps == []


@pytest.mark.parametrize(
    ("places", "n_over"),
    [
        ([(0, 0.5), (10, 0.5025), (20, 0.505)], 0),
        ([(0, 0.5), (10, 0.5026), (20, 0.5051)], 1),
        ([(0, 0.5), (10, 0.45)], 1),
        ([(0, 0.5), (300, 0.6)], 0),
        ([(0, 0.6999), (10, 0.7001)], 1),
    ],
    ids=["as fast as it may", "a little faster", "a jump", "a jump after it was let go", "outside"],
)
def test_targets_beyond_limits_count(places: list[tuple[int, float]], n_over: int, tmp_path: Path) -> None:
    kept = recorded(tmp_path, [target(ms, x_m) for ms, x_m in places])
    assert (kept.arm_targets, kept.arm_over) == (len(places), n_over)


@pytest.fixture
def standing() -> Standstills:
    still = Standstills()
    still._found.append((0, 2**62))
    return still


def test_a_case_is_tried_again_while_the_machine_stands_still_and_only_then(standing: Standstills) -> None:
    tries = count(1)
    assert [n for n, _ in run_cases([CampaignCase({}, lambda: next(tries))], standing, attempts=4)] == [4]
    tries = count(1)
    cases = [CampaignCase({}, lambda: next(tries))] * 2
    assert list(run_cases(cases, Standstills(), attempts=4)) == [(1, 0), (2, 0)]


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
