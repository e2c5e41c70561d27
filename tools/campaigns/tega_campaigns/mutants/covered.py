"""Note which test runs which line, and how long it takes: a plugin of pytest for a run under coverage."""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from pathlib import Path

import pytest

_TOOK_S: dict[str, float] = {}
_FAILED: set[str] = set()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Name the lines that are run from here on by the test."""
    from coverage import Coverage

    measured = Coverage.current()
    if measured is not None:
        measured.switch_context(item.nodeid)
    return (yield)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add a phase of a test to its time."""
    _TOOK_S[report.nodeid] = _TOOK_S.get(report.nodeid, 0.0) + report.duration
    if report.outcome != "passed":
        _FAILED.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Write the time of every test that passed."""
    passed = {name: took_s for name, took_s in _TOOK_S.items() if name not in _FAILED}
    Path(os.environ["TEGA_TOOK"]).write_text(json.dumps(passed))
