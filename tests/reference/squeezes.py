"""Squeezes of a ball out of the shared recordings: EMG of three channels beside the force."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from tega_learn.compare import Log

ROOT = Path(__file__).resolve().parents[2]
DATA: Final = Path(os.environ.get("TEGA_DATA", ROOT.parent / "shared" / "data")) / "emg"


def there(path: Path) -> Path:
    """Return a path of the shared recordings; skip the test where it is absent."""
    if not path.exists():
        pytest.skip(f"{path} is not there; set TEGA_DATA to the folder of the shared recordings")
    return path


@cache
def squeezes(name: str) -> Log:
    """Return channels 3, 6 and 8 of a recording such as "v1", 200 samples a second."""
    scipy_io = pytest.importorskip("scipy.io", reason="scipy is not installed")
    loaded = scipy_io.loadmat(there(DATA / "my_thesis" / f"recording_force_{name}.mat"))
    force = np.asarray(loaded["Force"], np.float64).ravel()
    emg = np.asarray(loaded["emg"], np.float64)[:, [2, 5, 7]]
    n = min(len(emg), len(force))
    return Log(name, emg[:n], force[:n], 200.0)
