"""Do what a command of `tega-teleop` does, and say at its end when each stage of its start was reached.

:mod:`tega_figures.bench.start` runs it as a program of its own. It loads nothing that the command does not.
"""

from __future__ import annotations

import json
import logging
import sys
import time


class _Reached(logging.Handler):
    """Notes when each stage was reached."""

    def __init__(self, began_s: float) -> None:
        super().__init__()
        self._began_s = began_s
        self.stages_s = {"interpreter": time.monotonic() - began_s}

    def emit(self, record: logging.LogRecord) -> None:
        """Note one."""
        self.stages_s[record.getMessage()] = time.monotonic() - self._began_s


def _run() -> None:
    stages = _Reached(float(sys.argv[1]))
    log = logging.getLogger("tega.start")
    log.setLevel(logging.DEBUG)
    log.addHandler(stages)
    sys.argv[1:] = sys.argv[2:]
    from tega.ui.cli.main import main

    try:
        main()
    finally:
        sys.stderr.write(json.dumps(stages.stages_s) + "\n")


if __name__ == "__main__":
    _run()
