"""A hand is let go of even if the program that steers it is killed or stands still."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

import pytest

from reference.hand_bench import PATIENT, limp, patient, pushes, steering
from reference.processes import begun_by, hand_guards, until
from tega.devices.hand import guard_process, hand_guard
from tega.devices.hand.guard_process import GuardProcess
from tega.devices.hand.hand_guard import guard_runs
from tega.devices.hand.hand_loop import HandLoop
from tega.devices.hand.hand_reports import HandOrders
from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import python_command, python_environment
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_frozen_process_of_the_hand_does_not_leave_it_pushing(how: signal.Signals) -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        (steers,) = begun_by(running.pid, "tega.devices.hand.hand_program")
        os.kill(steers, how)
        until(lambda: limp(hand))
        until(lambda: not hand.say("look")["reports"])
        assert running.wait() == 1


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_frozen_program_without_a_guard_lets_go_of_the_hand(how: signal.Signals) -> None:
    with Emulator("allegro_port") as hand, steering(hand, guard=False) as running:
        assert hand_guards(running.pid) == []
        running.send_signal(how)
        until(lambda: limp(hand))


def test_a_frozen_program_that_goes_on_steers_again_and_one_frozen_with_its_hand_process_lets_go() -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        running.send_signal(signal.SIGSTOP)
        until(lambda: limp(hand))
        running.send_signal(signal.SIGCONT)
        until(lambda: pushes(hand))
        for pid in (*begun_by(running.pid, "tega.devices.hand.hand_program"), running.pid):
            os.kill(pid, signal.SIGSTOP)
        until(lambda: limp(hand))


def test_a_closed_terminal_lets_go_of_the_hand() -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        running.send_signal(signal.SIGHUP)
        assert running.wait() == 128 + signal.SIGHUP
        until(lambda: limp(hand))


def test_files_in_the_working_folder_do_not_take_the_guard_s_place(tmp_path: Path) -> None:
    for name in ("can", "select", "json", "msgspec", "numpy", "tega"):
        (tmp_path / f"{name}.py").write_text("open('was_run', 'w').close()\n")
    with Emulator("allegro_port") as hand, steering(hand, tmp_path) as running:
        running.kill()
        until(lambda: limp(hand))
    assert not (tmp_path / "was_run").exists()


def test_a_program_that_is_started_finds_nothing_in_the_working_folder(tmp_path, monkeypatch) -> None:
    (tmp_path / "can.py").write_text("raise SystemExit('the wrong one')\n")
    monkeypatch.chdir(tmp_path)
    kept = str(tmp_path / "elsewhere")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", ".", str(tmp_path), kept]))
    assert python_environment()["PYTHONPATH"] == kept
    words = python_command("tega.ui.cli", "--version")
    done = subprocess.run(words, env=python_environment(), capture_output=True, text=True, check=True)
    assert done.stdout.startswith("tega ")
    program = words[3].partition("import runpy")[0] + "import can; print(can.__file__)"
    check = [*words[:3], program, *words[4:]]
    found = subprocess.run(check, env=python_environment(), capture_output=True, text=True, check=True)
    assert tmp_path not in Path(found.stdout.strip()).parents


def test_a_hand_is_not_switched_on_without_a_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(_bus: object, _frames: object, *, device_id: int) -> GuardProcess:  # noqa: ARG001
        return GuardProcess("lets go of the hand", "tega.no_such_program")

    monkeypatch.setattr("tega.devices.hand.hand_loop.guard_hand", absent)
    with Emulator("allegro_port") as hand:
        loop = HandLoop(patient(hand), HandOrders(), lambda *_: None)
        with pytest.raises(DeviceUnavailableError, match="that lets go of the hand did not start"):
            loop.warm_up()
        assert hand.say("look")["torques"] == 0
        assert not hand.say("look")["servo_on"]


def test_the_guard_that_took_the_lost_one_s_place_lets_go_of_the_hand() -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        for pid in hand_guards(running.pid):
            os.kill(pid, signal.SIGKILL)
        assert running.stdout is not None
        assert running.stdout.readline() == b"replaced\n"
        assert any(hand.say("look")["duties"])
        running.kill()
        until(lambda: limp(hand))


def test_a_deaf_hand_is_not_left_alone(capfd: pytest.CaptureFixture[str]) -> None:
    with Emulator("allegro_port") as hand:
        program = (
            "from tega.devices.hand.allegro import Allegro, AllegroOptions\n"
            f"with Allegro(AllegroOptions(**{ {**hand.address, **PATIENT}!r}, reconnects=50)) as hand:\n"
            "    try:\n"
            "        while True:\n"
            "            hand.step(5)\n"
            "            __import__('time').sleep(0.003)\n"
            "    except KeyboardInterrupt:\n"
            "        pass\n"
            "print('stopped')\n"
        )
        with subprocess.Popen(
            [sys.executable, "-P", "-c", program], stderr=subprocess.PIPE, text=True
        ) as running:
            until(lambda: pushes(hand))
            hand.say("silence")
            running.send_signal(signal.SIGINT)
            _, message = running.communicate(timeout=60)
        assert not limp(hand)
        last = message.strip().splitlines()[-1]
        assert last.startswith("USE THE HAND'S EMERGENCY SWITCH: ")
        assert "has not confirmed that its motors are off" in last
        named = re.search(r"process (\d+) goes on", last)
        assert named is not None
        assert guard_runs(int(named[1]))
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):  # a log-out afterwards
            os.kill(int(named[1]), number)
        hand.say("clear")
        until(lambda: limp(hand))
    assert "stopped" in capfd.readouterr().out


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_run_that_has_lost_hand_process_and_guard_lets_go_of_the_hand(how, capfd) -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        steers, guards = begun_by(running.pid, "tega.devices.hand.hand_program"), hand_guards(running.pid)
        for pid in (*guards, *steers):
            os.kill(pid, how)
        until(lambda: limp(hand))
        assert running.wait() == 1
        for pid in guards:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
    assert "SWITCH" not in capfd.readouterr().err


def test_last_words_name_no_process_that_does_not_run(capfd: pytest.CaptureFixture[str]) -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        steers, guards = begun_by(running.pid, "tega.devices.hand.hand_program"), hand_guards(running.pid)
        hand.say("silence")
        for pid in (*guards, *steers):
            os.kill(pid, signal.SIGKILL)
        while running.poll() is None:
            for pid in hand_guards(running.pid):  # those that the program starts itself
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.01)
        last = capfd.readouterr().err.strip().splitlines()[-1]
        assert last.startswith("USE THE HAND'S EMERGENCY SWITCH: ")
        assert last.endswith("no other process goes on switching it off")


def test_a_guard_that_gives_up_writes_to_the_system_s_log(monkeypatch: pytest.MonkeyPatch) -> None:
    logged: list[str] = []
    monkeypatch.setattr(guard_process, "log_to_system", logged.append)
    monkeypatch.setattr(guard_process, "_OVERDUE_S", 0.05)
    monkeypatch.setattr(hand_guard, "LONGEST_S", 0.3)
    bus = {"interface": "virtual", "channel": "nobody", "bitrate": 1_000_000}
    pieces: SimpleQueue[bytes] = SimpleQueue()
    for piece in (b".\n", b""):
        pieces.put(piece)
    answers: list[bytes] = []
    monkeypatch.setattr(guard_process, "receive", lambda: pieces)
    monkeypatch.setattr(guard_process, "_answer", answers.append)
    monkeypatch.setattr(guard_process, "stay_alone", lambda: None)
    hand = hand_guard._Hand(bus, [], 0)
    guard_process.stand_by(hand.label, hand.let_go)
    assert b"off\n" not in answers
    assert len(logged) == 2
    assert "not confirmed to be off after" in logged[0]
    assert logged[1].startswith("robot hand on virtual nobody: not confirmed to be off (no answer")
    assert logged[1].endswith("use its switch")
