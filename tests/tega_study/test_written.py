"""What holds recordings and project files against their public readers finds what is wrong with one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reference.sessions import record
from reference.written import boris_project, mcap_trouble
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.score import export_boris
from tega_study.state import resume


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return record(tmp_path_factory.mktemp("written") / "rec").read_bytes()


def test_a_recording_of_ours_is_taken(recording: bytes) -> None:
    assert mcap_trouble(recording) == ""


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_wrong_byte_among_the_messages_is_found(recording: bytes, share: float) -> None:
    broken = bytearray(recording)
    broken[round(share * len(recording))] ^= 0xFF
    assert mcap_trouble(bytes(broken))


@pytest.mark.parametrize("from_end", [13, 60, 200])
def test_a_wrong_byte_of_the_summary_is_found(recording: bytes, from_end: int) -> None:
    broken = bytearray(recording)
    broken[-from_end] ^= 0xFF
    assert mcap_trouble(bytes(broken))


def test_a_recording_that_was_cut_off_is_found(recording: bytes) -> None:
    assert mcap_trouble(recording[: len(recording) // 2])


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Return the project of a study with one trial to score."""
    folder = tmp_path / "study"
    write_plan(make_plan(participants=1, seed=5, objects=["bag"], trials=2, simulated=True), folder)
    with resume(folder, read_plan(folder), "p01", t_ns=0, where="simulated")[0] as journal:
        journal.add("trial_start", t_ns=10, trial=1, source="auto")
        journal.add("trial_end", t_ns=2_000_000_010, trial=1, status="done", success=True, source="auto")
    assert export_boris(folder, tmp_path / "out.boris") == 1
    return tmp_path / "out.boris"


def test_boris_opens_a_project_and_finds_a_behaviour_that_is_none(project: Path) -> None:
    tree = boris_project(project)
    if tree is None:
        pytest.skip("boris-behav-obs is in an environment of .ci/extras")
    assert list(tree["observations"]) == ["p01_t01_a1"]
    assert {one["code"]: one["key"] for one in tree["behaviors_conf"].values()}["slip"] == "s"
    changed = json.loads(project.read_text())
    changed["observations"]["p01_t01_a1"]["events"] = [[1.0, "", "sneeze", "", ""]]
    project.write_text(json.dumps(changed))
    with pytest.raises(AssertionError, match="sneeze"):
        boris_project(project)
