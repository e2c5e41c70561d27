"""A Chromium on this machine, to open the view's page in: tests skip without one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tega_figures import chromium as browsers
from tega_figures.chromium import opened

__all__ = ["chromium", "launched", "opened"]


def chromium() -> str:
    """Return the path of the browser, or skip the test that asks."""
    pytest.importorskip(
        "playwright.sync_api", reason="no browser test: pip install '.[browser]' for playwright"
    )
    return browsers.chromium() or pytest.skip(
        f"no browser test: none of {', '.join(browsers.NAMES)} is installed (Debian: apt install chromium)"
    )


@contextmanager
def launched() -> Iterator[Any]:
    """Start the browser; end it afterwards."""
    chromium()
    with browsers.launched() as browser:
        yield browser
