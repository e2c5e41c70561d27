"""Ctrl-C ends the demo without the picture, and at once while it still prepares."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from reference.processes import until
from tega.safety.stop import CtrlC
from tega_sim.cli.demo import demo

pytest.importorskip("mujoco", reason="needs the extra sim")
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals as on Linux and macOS")


@posix
def test_the_first_ctrl_c_interrupts_only_where_nothing_runs() -> None:
    with CtrlC() as stop:
        with pytest.raises(KeyboardInterrupt), stop.interrupting():
            os.kill(os.getpid(), signal.SIGINT)
        assert stop.requested
    with CtrlC() as stop:
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.requested


@posix
def test_preparing_is_interrupted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    begun: list[str] = []
    monkeypatch.setattr("tega_sim.demo.lab_of", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    monkeypatch.setattr("tega_sim.demo.run_trial", lambda *_, **__: begun.append("trial"))
    result = CliRunner().invoke(demo, ["--out", str(tmp_path / "out")])
    assert result.exit_code == 1  # click's for an interrupt; the program's own is 130
    assert "Aborted" in result.output
    assert begun == []


@posix
@pytest.mark.slow
def test_a_running_demo_leaves_its_tables_and_draws_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = [sys.executable, "-m", "tega.ui.cli", "demo", "--json", "--out", str(out)]
    words += ["--record", str(tmp_path / "rec")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        until(lambda: any((tmp_path / "rec").glob("*.mcap*")))
        process.send_signal(signal.SIGINT)
        message, noted = process.communicate()
    assert process.returncode == 130
    assert message == ""
    assert noted.split("\n") == [f"tables and summary.json are in {out}", "", "stopped", ""]
    report: Any = json.loads((out / "summary.json").read_text())
    assert len(report["trials"]) == 1
    assert list(out.glob("1-bottle/*.csv"))
    assert not (out / "demo.png").exists()
