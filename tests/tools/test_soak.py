"""A short soak, and what its verdict depends on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tega.ui.cli.main import main
from tega_campaigns.soak.plan import KINDS, plan
from tega_campaigns.soak.report import SoakFault, SoakReport
from tega_campaigns.soak.trial import soak

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="emulated devices need pseudo-terminals, limits Linux"
)


@pytest.mark.slow
def test_a_short_soak_passes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["soak", "--seconds", "60", "--seed", "1", "--patient", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0, report["failures"]
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
    """A report that passes."""
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
    """So many faults of which nothing can be said."""
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
def test_each_thing_that_is_wrong_fails_a_soak_and_nothing_else_does(
    name: str, value: object, word: str
) -> None:
    report = good()
    report.judge()
    assert report.passed
    setattr(report, name, value)
    report.judge()
    assert not report.passed
    assert word in report.failures[0]
