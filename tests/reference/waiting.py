"""Waiting for what another thread does."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest


def until(what: Callable[[], bool]) -> None:
    """Return once it is so; fail after fifteen seconds."""
    for _ in range(7500):
        if what():
            return
        time.sleep(0.002)
    pytest.fail("nothing happened for 15 s")
