"""What the figures were measured on."""

from __future__ import annotations

import os
import platform
import sys
from importlib import metadata
from pathlib import Path

import msgspec

from tega import _native

__all__ = ["Machine", "describe_machine"]

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
