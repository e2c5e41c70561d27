"""What all campaigns share: one runner, one supervisor, one way to report."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="needs the extra net")

from tega.errors import DeviceUnavailableError
from tega_campaigns.runner import CampaignCase, run_cases
from tega_campaigns.standstill import Standstills
from tega_campaigns.supervisor import SaidLine, Supervisor


@pytest.fixture
def standing() -> Standstills:
    """A machine that stands still all the time."""
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
