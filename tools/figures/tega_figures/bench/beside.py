"""Measure the processor time of programs beside a bench."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

__all__ = ["processor_s"]


def processor_s(pids: Sequence[int]) -> float:
    """Return the processor time of some processes and of all that they have started, seconds; 0 but on Linux."""
    if sys.platform != "linux":
        return 0.0
    begun_by, used = dict[int, int](), dict[int, int]()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, fields = int(stat.parent.name), stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        begun_by[pid], used[pid] = int(fields[1]), sum(map(int, fields[11:15]))

    def belongs(pid: int) -> bool:
        while pid > 1:
            if pid in pids:
                return True
            pid = begun_by.get(pid, 0)
        return False

    return sum(ticks for pid, ticks in used.items() if belongs(pid)) / os.sysconf("SC_CLK_TCK")
