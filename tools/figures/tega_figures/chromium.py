"""Open pages in a Chromium of this machine, without a window, to look at them and to take pictures."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

__all__ = ["HEIGHT_PX", "NAMES", "WIDTH_PX", "chromium", "launched", "opened"]

NAMES: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
"""Of the programs that are looked for."""

# WebGL without a graphics card.
_FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WIDTH_PX: Final = 1440
HEIGHT_PX: Final = 810
"""Of a window, where nothing else is said."""


def chromium() -> str | None:
    """Return the path of the browser; ``None`` where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name)) is not None), None)


@contextmanager
def launched() -> Iterator[Any]:
    """Start the browser; end it afterwards."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=list(_FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: Any, url: str, *, width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> Iterator[Any]:
    """Open the view's page in a browser from :func:`launched`; close it afterwards."""
    page = browser.new_page(viewport={"width": width_px, "height": height_px})
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
