"""Waiting for what another thread does."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pytest

# Who takes a guard out knows that there is nothing to wait for.
_PATIENCE_S = float(os.environ.get("TEGA_PATIENCE_S", "60"))


def until(subject: Callable[[], bool]) -> None:
    """Return once it is so; fail after a minute, which a busy machine may need."""
    end_s = time.monotonic() + _PATIENCE_S
    while not subject():
        if time.monotonic() > end_s:
            pytest.fail(f"nothing happened for {_PATIENCE_S:g} s")
        time.sleep(0.002)
