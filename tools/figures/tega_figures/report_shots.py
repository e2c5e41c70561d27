"""Take the pictures of a study's report: ``python -m tega_figures.report_shots STUDY/report.html docs/images``.

The report is one file, which Chromium opens from the disk. Each picture goes from one part of the page to the next.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tega_figures.chromium import launched

__all__ = ["PARTS", "main"]

PARTS: Final = {
    "study-report.png": ("h1", "h2:has-text('What differs from')"),
    "study-touch.webp": ("h2:text-is('Touch and pose')", "figure:has-text('Share of time at each pose')"),
}
"""Where a picture begins and what stands below its end, as Playwright's selectors, by its name."""

_WIDTH_PX, _MARGIN_PX = 892, 16


def main(report: Path, images: Path, width_px: int = _WIDTH_PX) -> None:
    """Write every picture into a folder.

    Raises:
        SystemExit: The report lacks a part.
    """
    with launched() as browser:
        page: Any = browser.new_page(viewport={"width": width_px, "height": 1200})
        page.goto(report.resolve().as_uri())
        for name, parts in PARTS.items():
            if not all(page.locator(part).count() for part in parts):
                raise SystemExit(f"{report}: has no {' or no '.join(parts)}, which {name} shows")
            top, bottom = (page.locator(part).first.bounding_box()["y"] for part in parts)
            top = max(0.0, top - _MARGIN_PX)
            clip = {"x": 0, "y": top, "width": width_px, "height": bottom - _MARGIN_PX - top}
            taken = Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip))).convert("RGB")
            # 256 colours do for text, and would put steps into the cameras' pictures.
            if name.endswith(".png"):
                taken.quantize(256).save(images / name, optimize=True)
            else:
                taken.save(images / name, quality=88, method=6)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
