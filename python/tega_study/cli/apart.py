"""Start a process that writes a study's report: the memory of sessions and that of statistics do not add up then.

Run as a program this is ``tega-teleop study report``.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tega.runtime.child_process import python_command, python_environment


def report_apart(folder: Path) -> Path:
    """Write a study's report in another process, and return its page.

    That process prints its errors on this one's standard error; if it fails, this one exits with its exit
    code.
    """
    done = subprocess.run(
        python_command(__name__, str(folder)),
        env=python_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode < 0:
        print(
            f"error: {folder}: the process that wrote its report was ended by signal {-done.returncode}",
            file=sys.stderr,
        )
        print("hint: tega-teleop study report writes it again", file=sys.stderr)
        sys.exit(1)
    if done.returncode:
        sys.exit(done.returncode)
    return folder / "report.html"


if __name__ == "__main__":
    from tega.ui.cli.main import main

    main(["study", "report", *sys.argv[1:]])
