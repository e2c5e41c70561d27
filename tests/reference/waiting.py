"""Waiting for what another thread does."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

_PATIENCE_S = 60.0


def until(what: Callable[[], bool]) -> None:
    """Return once it is so; fail after a minute, which a busy machine may need."""
    end_s = time.monotonic() + _PATIENCE_S
    while not what():
        if time.monotonic() > end_s:
            pytest.fail(f"nothing happened for {_PATIENCE_S:g} s")
        time.sleep(0.002)
