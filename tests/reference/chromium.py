"""A Chromium on this machine, to open the view's page in and take pictures of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

SIZE = {"width": 1440, "height": 810}
# WebGL without a graphics card.
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def chromium() -> str:
    """Return the path of the browser, or skip the test that asks."""
    pytest.importorskip(
        "playwright.sync_api", reason="no browser test: pip install '.[browser]' for playwright"
    )
    for name in NAMES:
        if (path := shutil.which(name)) is not None:
            return path
    return pytest.skip(
        f"no browser test: none of {', '.join(NAMES)} is installed (Debian: apt install chromium)"
    )


@contextmanager
def launched() -> Iterator[Any]:
    """Start the browser; end it afterwards."""
    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: Any, url: str) -> Iterator[Any]:
    """Open the view's page; close it afterwards."""
    page = browser.new_page(viewport=SIZE)
    # Without a graphics card, and beside other work, a picture of the scene takes its time.
    page.set_default_timeout(180_000)
    try:
        page.goto(url)
        # viser warns, sooner or later, where WebGL has no graphics card behind it.
        page.add_style_tag(content=".mantine-Notification-root { display: none !important }")
        page.locator("canvas").first.wait_for()
        yield page
    finally:
        page.close()
