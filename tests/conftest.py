"""Hypothesis profiles, signals, a sure end, and the folder of real recordings."""

from __future__ import annotations

import faulthandler
import os
import signal
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("dev", deadline=None, max_examples=60)
settings.register_profile("ci", deadline=None, max_examples=100, derandomize=True)
settings.register_profile(
    "deep", deadline=None, max_examples=2000, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "dev"))

# A shell's background job ignores Ctrl-C, and so would every program that the tests start and stop by it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# What plays devices, stations and the person at a wizard.
PLAYERS = ("tega.testing", "reference.held", "reference.wizard")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Ask a test with programs beside it once more where it fails, and say so (RERUN).

    Emulated devices keep true time. On a machine that stands still for seconds a device rightly takes the run for
    dead, or the run the device. Tests that compute in this program alone are never repeated.
    """
    for item in items:
        if item.path.parent.name in {"contract", "hazards"} or _has_programs(getattr(item, "module", None)):
            item.add_marker(pytest.mark.flaky(reruns=1))


def _has_programs(module: object) -> bool:
    """Whether a test module starts programs, itself or through what plays devices and stations."""
    used = vars(module).values() if module is not None else ()
    return any(one is subprocess or str(getattr(one, "__module__", "")).startswith(PLAYERS) for one in used)


def pytest_unconfigure() -> None:
    """Say which thread keeps the tests from ending, and end: a run of them never hangs after its last line."""
    faulthandler.dump_traceback_later(120, exit=True)


PROJECT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return the folder of real recordings, or skip: they are not part of the project."""
    folder = Path(os.environ.get("TEGA_DATA", PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}; set TEGA_DATA to the folder that holds digit/ and emg/")
    return folder
