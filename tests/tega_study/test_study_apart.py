"""A simulated study's report is written by a process of its own, so that none takes more than 250 MB."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
pytest.importorskip("statsmodels", reason="needs the extra tega[study]")

from tega_study.cli.simulate import report_apart

MOST_MB = 250
STUDY = ["study", "simulate", "--operators", "1", "--trials", "1", "--objects", "bag", "--jobs", "1", "--out"]
PROGRAM = """
import resource, sys
from tega.ui.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
# Not the resource usage of this process, which has that of the program it was forked from.
own = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
report = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(own, report, *{"statsmodels", "matplotlib"} & set(sys.modules), file=sys.stderr)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the memory of a process")
def test_neither_the_sessions_nor_the_report_take_more_than_250_mb(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *STUDY, str(tmp_path / "s")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "s" / "report.html").is_file()
    assert done.stdout.startswith(str(tmp_path / "s" / "report.html"))
    own, report, *loaded = done.stderr.splitlines()[-1].split()
    assert not loaded
    assert int(own) / 1024 < MOST_MB
    assert int(report) / 1024 < MOST_MB


def test_a_report_that_cannot_be_written_is_told_and_ends_the_program(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as found:
        report_apart(tmp_path / "nothing")
    assert found.value.code == 1
    assert "error:" in capfd.readouterr().err
