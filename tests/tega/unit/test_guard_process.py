"""A guard that is lost just before the program closes its device, and the start of the process that steers a hand."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from io import BufferedReader, BufferedWriter
from pathlib import Path

import pytest

from reference.processes import until
from tega.devices.hand import guard_process, hand_ends
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.guard_process import GuardProcess
from tega.errors import TegaError
from tega.runtime import child_process

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


_NO_PERSON = AllegroOptions(interface="slcan", channel="/dev/null", guard=False)


def test_each_stage_of_the_start_is_told() -> None:
    words = child_process.python_command("tega.devices.hand.hand_program")
    process = subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=child_process.python_environment()
    )
    assert isinstance(process.stdin, BufferedWriter)
    assert isinstance(process.stdout, BufferedReader)
    try:
        child_process.send_object(process.stdin, (_NO_PERSON, False))
        assert [child_process.receive_object(process.stdout) for _ in range(2)] == [hand_ends.MAKES_READY] * 2
        child_process.send_object(process.stdin, False)
        assert isinstance(child_process.receive_object(process.stdout), TegaError)  # no such adapter
    finally:
        child_process.end_child(process, 5.0)
        process.stdout.close()


def test_one_that_says_nothing_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand_ends, "_START_S", 0.3)
    steers = hand_ends.HandProcess(_NO_PERSON, lambda _spoken, _news: None)
    steers.warm_up()
    os.kill(steers.pid, signal.SIGSTOP)
    with pytest.raises(TegaError, match="did not start") as reported:
        steers.open(whole=False)
    assert reported.value.hint.startswith("it said nothing for 0.3 s")
