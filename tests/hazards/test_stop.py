"""Every way out of a run leaves hand and vest safe: the command itself, on emulated devices."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from hazards.bench import Lab, closed, column, lab
from reference.processes import in_terminal

pytestmark = pytest.mark.slow

whole = partial(lab, emg=True, hand=True, vest=True, fingers=("thumb",))


def start(made: Lab, *, largest_file: int = resource.RLIM_INFINITY) -> subprocess.Popen[bytes]:
    """Start ``tega-teleop run`` and wait until the hand is closed and the touch is felt."""
    # Tests may themselves run under nohup; a file larger than its limit is refused by the kernel, as by a full disk.
    first = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({largest_file}, {largest_file}))\n"
        "from tega.ui.cli.main import main\n"
        "main(sys.argv[1:])\n"
    )
    words = [sys.executable, "-c", first, "run", str(made.write_settings()), "--json"]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    made.running.append(running)
    made.until(lambda: running.poll() is not None or (column(made, 0) and closed(made)))
    assert running.poll() is None, running.communicate()
    return running


@pytest.mark.parametrize(
    ("number", "reason"),
    [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM"), (signal.SIGHUP, "SIGHUP")],
)
def test_a_signal_stops_and_leaves_all_safe(tmp_path: Path, number: signal.Signals, reason: str) -> None:
    with whole(tmp_path) as made:
        running = start(made)
        running.send_signal(number)
        out, err = running.communicate(timeout=60)
        assert made.limp()
        made.until(made.at_rest)
    summary = json.loads(out)
    assert summary["ended"] == "stopped"
    assert err.splitlines()[-1] == b"stopped"
    assert summary["safety"]["changes"][-1] == {
        "t_s": summary["duration_s"], "state": "stopped", "reason": f"stopped: {reason}"
    }  # fmt: skip
    assert running.returncode == 130


def test_impatience_stops_as_well(tmp_path: Path) -> None:
    with whole(tmp_path) as made:
        running = start(made)
        while running.poll() is None:
            running.send_signal(signal.SIGINT)
            time.sleep(0.02)
        running.communicate(timeout=60)
        assert made.limp()
        made.until(made.at_rest)
    # The last ones may have met an interpreter that had already put its signals away.
    assert running.returncode in {130, -signal.SIGINT}


def test_a_key_stops(tmp_path: Path) -> None:
    with whole(tmp_path) as made:
        with in_terminal("run", made.write_settings()) as (running, keys, drawn):
            made.until(lambda: b"ACTIVE" in drawn() and column(made, 0) and closed(made))
            os.write(keys, b" ")
            made.until(lambda: (drawn(), running.poll())[1] is not None)
            out = drawn()
        assert made.limp()
        made.until(made.at_rest)
    assert running.returncode == 130
    assert b"stopped: 0" not in out
    assert b"the space bar" in out


def test_the_set_time_stops(tmp_path: Path) -> None:
    with whole(tmp_path, session={"duration_s": 3.0}) as made:
        with made.session():
            made.until(lambda: made.state == "stopped")
        assert made.limp()
        made.until(made.at_rest)
    assert made.summary["ended"] == "duration"
    assert made.changes[-1].reason == "the set time is over"


def test_an_error_in_the_program_stops(tmp_path: Path) -> None:
    felt: list[bool] = []

    def burst(_view: object) -> None:
        if felt:
            raise ZeroDivisionError("a mistake")

    with whole(tmp_path) as made:
        with made.session(observe=burst, ends=pytest.raises(ZeroDivisionError)):
            made.until(lambda: column(made, 0) and closed(made))
            felt.append(True)
            made.until(lambda: made.state == "stopped")
        assert made.limp()
        made.until(made.at_rest)
    assert made.changes[-1].reason == "stopped: a mistake"


def test_a_full_disk_ends_the_tables_and_not_the_run(tmp_path: Path) -> None:
    with whole(tmp_path, session={"out_dir": str(tmp_path / "out")}) as made:
        running = start(made, largest_file=100_000)
        table = tmp_path / "out" / "can.csv"
        made.until(lambda: table.stat().st_size >= 100_000)
        time.sleep(0.5)
        assert running.poll() is None
        assert closed(made)
        assert column(made, 0)
        running.send_signal(signal.SIGINT)
        out, _ = running.communicate(timeout=60)
        assert made.limp()
    summary = json.loads(out)
    assert any("disk: tables are no longer written" in text for text in summary["safety"]["alerts"])
    assert summary["ended"] == "stopped"
