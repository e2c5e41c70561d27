"""The guard of a device is lost just before the program closes the device: its successor is treated likewise."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from reference.processes import until
from tega.devices.hand import guard_process
from tega.devices.hand.guard_process import GuardProcess

# Says that it lets go by a file of its own number, and starts slowly once a first one has begun.
GUARD = """
import os, sys, time
from pathlib import Path
from tega.devices.hand.guard_process import stand_by

folder = Path(sys.argv[1])
(folder / f"begun-{os.getpid()}").touch()
if len(list(folder.glob("begun-*"))) > 1:
    end_s = time.monotonic() + 60
    while not (folder / "go on").exists() and time.monotonic() < end_s:
        time.sleep(0.01)
stand_by("a file", lambda _goes_on: (folder / f"let-go-{os.getpid()}").touch() or "")
(folder / f"ended-{os.getpid()}").touch()
"""


@pytest.fixture
def guard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GuardProcess]:
    """A guard that has heard the program; its next one waits for the file ``go on`` before it is ready."""
    (tmp_path / "slow_guard.py").write_text(GUARD)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    guard = GuardProcess("guards a file", "slow_guard", str(tmp_path))
    guard.beat()
    until(lambda: guard._received_s > guard._requested_s)
    first = guard.pid
    yield guard
    with contextlib.suppress(ProcessLookupError):  # a stopped one ends no other way
        os.kill(first, signal.SIGKILL)


@pytest.fixture
def lost(guard: GuardProcess, tmp_path: Path) -> GuardProcess:
    """A guard whose process was killed, and whose second one has begun and is not ready."""
    os.kill(guard.pid, signal.SIGKILL)
    until(lambda: len(list(tmp_path.glob("begun-*"))) == 2)
    return guard


def one(folder: Path, subject: str) -> Callable[[], bool]:
    return lambda: len(list(folder.glob(f"{subject}-*"))) == 1


def test_a_device_that_is_left_while_its_guard_is_replaced_is_let_go_of(
    lost: GuardProcess, tmp_path: Path
) -> None:
    (tmp_path / "go on").touch()
    lost.leave_to_it()
    until(one(tmp_path, "let-go"))


@pytest.mark.parametrize("fate", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_a_device_that_is_left_before_its_guard_s_loss_is_seen_is_let_go_of(
    guard: GuardProcess, tmp_path: Path, fate: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "go on").touch()
    monkeypatch.setattr(guard_process, "DEAF_S", 0.2)
    before = guard.pid
    os.kill(before, signal.SIGSTOP)
    if fate == signal.SIGKILL:
        closing = guard._closing.set

        def killed_meanwhile() -> None:
            closing()
            os.kill(before, signal.SIGKILL)

        monkeypatch.setattr(guard._closing, "set", killed_meanwhile)
    guard.leave_to_it()
    until(one(tmp_path, "let-go"))
    assert not (tmp_path / f"let-go-{before}").exists()


def test_a_device_that_is_left_to_its_guard_is_let_go_of_once(guard: GuardProcess, tmp_path: Path) -> None:
    guard.leave_to_it()
    until(one(tmp_path, "let-go"))
    assert len(list(tmp_path.glob("begun-*"))) == 1


def test_a_guard_that_is_dismissed_while_it_is_replaced_leaves_no_process(
    lost: GuardProcess, tmp_path: Path
) -> None:
    (tmp_path / "go on").touch()
    lost.dismiss()
    until(one(tmp_path, "ended"))
    until(lambda: lost._process.returncode is not None)
    assert not list(tmp_path.glob("let-go-*"))
