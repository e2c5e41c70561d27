"""Waiting for what another thread does."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest


def until(what: Callable[[], bool]) -> None:
    """Return once it is so; fail after ten seconds."""
    for _ in range(1000):
        if what():
            return
        time.sleep(0.01)
    pytest.fail("nothing happened for 10 s")
