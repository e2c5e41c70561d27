"""What the figures were measured on, and the processor time of programs beside a bench."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import msgspec

from tega import _native

__all__ = ["Machine", "describe_machine", "processor_s"]

# By the name to import and by the names under which a distribution may bring it.
_PACKAGES = {
    "numpy": ("numpy",),
    "scipy": ("scipy",),
    "opencv": (
        "opencv-contrib-python-headless",
        "opencv-python-headless",
        "opencv-python",
        "opencv-contrib-python",
    ),
    "numba": ("numba",),
}


class Machine(msgspec.Struct, frozen=True, kw_only=True):
    """The machine and the libraries.

    Attributes:
        n_cores: Logical cores that this process may use.
        load_per_core: One-minute load average over the cores when the run began; ``None`` where unknown.
        instruction_set: What the kernels use: baseline, neon or avx2.
        versions: Of TEGA, Python and the packages compared with, by name; those not installed are missing.
    """

    cpu: str
    n_cores: int
    load_per_core: float | None
    instruction_set: str
    system: str
    versions: dict[str, str]


def describe_machine() -> Machine:
    """Return what this run is measured on."""
    n_cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    load = os.getloadavg()[0] / n_cores if hasattr(os, "getloadavg") else None
    versions: dict[str, str] = {"tega": _native.__version__, "python": platform.python_version()}
    for name, distributions in _PACKAGES.items():
        for distribution in distributions:
            try:
                versions[name] = metadata.version(distribution)
            except metadata.PackageNotFoundError:
                continue
            break
    return Machine(
        cpu=_cpu_name(),
        n_cores=n_cores,
        load_per_core=None if load is None else round(load, 2),
        instruction_set=_native.instruction_set(),
        system=f"{platform.system()} {platform.machine()}",
        versions=versions,
    )


def _cpu_name() -> str:
    if sys.platform == "linux":
        try:
            lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        except OSError:
            lines = []
        for line in lines:
            if line.startswith(("model name", "Model")):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


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
