"""What the tests of studies share: a study with recorded trials, and a planner that draws few studies."""

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="module", autouse=True)
def _few_studies_are_drawn() -> Iterator[None]:
    """Draw few studies for what a report says of the next one: test_study_power.py shows what the draws find."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tega_study.power._RUNS", 20)
        yield


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a second and a half of made-up input: two fingertips, muscles, hand and vest."""
    from reference.sessions import record

    return record(tmp_path_factory.mktemp("recorded"), lossless=False)


@pytest.fixture(scope="session")
def clipped(tmp_path_factory: pytest.TempPathFactory, recording: Path) -> Path:
    """Return a study whose recorded trials are over; tests take copies."""
    from reference.clipped import clipped_study, planned

    return clipped_study(tmp_path_factory.mktemp("clipped") / "study", planned(), recording)
