"""Few studies are drawn for what a report says of the next one: test_study_power.py shows what the draws find."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _few_studies_are_drawn() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tega_study.power._RUNS", 20)
        yield
