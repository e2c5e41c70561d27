"""Take a picture of pages of the built site: ``python -m tega_figures.site_shots target/site docs/images``.

``make site`` builds it. The pages are opened from the disk, without a server, as a reader without a network has them.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tega_figures.chromium import launched

__all__ = ["PAGES", "main"]

PAGES: Final = (
    "index.html",
    "start/without-hardware.html",
    "tutorials/only-the-vest.html",
    "hardware/what-to-buy.html",
    "reference/settings.html",
    "performance.html",
)
"""One of each part of the site."""

_WINDOW_PX, _KEPT_PX, _COLUMNS, _GAP_PX = (1280, 860), (640, 430), 2, 8
_DRAWN_MS: Final = 3_000


def main(site: Path, images: Path) -> None:
    """Write ``site-pages.webp``: the tops of the pages, side by side."""
    width, height = _KEPT_PX
    n_rows = -(-len(PAGES) // _COLUMNS)
    size = (_COLUMNS * (width + _GAP_PX) - _GAP_PX, n_rows * (height + _GAP_PX) - _GAP_PX)
    sheet = Image.new("RGB", size, (222, 226, 230))
    with launched() as browser:
        shown: Any = browser.new_page(viewport=dict(zip(("width", "height"), _WINDOW_PX, strict=True)))
        shown.set_default_timeout(180_000)
        for place, page in enumerate(PAGES):
            shown.goto((site / page).as_uri())
            shown.wait_for_timeout(_DRAWN_MS)
            taken = Image.open(io.BytesIO(shown.screenshot())).convert("RGB")
            row, column = divmod(place, _COLUMNS)
            where = column * (width + _GAP_PX), row * (height + _GAP_PX)
            sheet.paste(taken.resize(_KEPT_PX, Image.Resampling.LANCZOS), where)
    sheet.save(images / "site-pages.webp", quality=80, method=6)


if __name__ == "__main__":
    main(*(Path(word).resolve() for word in sys.argv[1:]))
