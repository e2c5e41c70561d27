"""Fingers have the same colours on the page and in the drawings."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tega.ui.view.browser.vest import vest_svg
from tega.ui.view.figures import FINGER_COLOURS

PROJECT = Path(__file__).resolve().parents[2]
IMAGES = PROJECT / "docs" / "images"
MAKEFILE = PROJECT / "Makefile"

pytestmark = pytest.mark.skipif(not MAKEFILE.is_file(), reason="not a checkout")


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour as WCAG 2 has it."""
    shares = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize(("finger", "colour"), FINGER_COLOURS.items())
def test_a_finger_has_one_colour_on_the_page_and_in_the_drawings(finger: str, colour: str) -> None:
    assert vest_svg(None).count(f'fill="{colour}">{finger}</text>') == 2
    assert vest_svg(None).count(f'stroke="{colour}"') == 10
    for name in ("placement-vest.svg", "placement-vest-left.svg"):
        assert re.search(
            rf'fill="{colour}"/><text[^>]*>{finger}<', (IMAGES / name).read_text(encoding="utf-8")
        )
    assert (IMAGES / "wire-x40.svg").read_text(encoding="utf-8").count(colour) == 10
    # Words in the colour on white, and black words on it: WCAG 2 asks for 4.5.
    assert 1.05 / (luminance(colour) + 0.05) > 4.5
    assert (luminance(colour) + 0.05) / 0.05 > 4.5


def test_the_colours_of_the_fingers_are_spelt_once() -> None:
    sources = [
        path
        for folder in ("python", "tools", "docs")
        for path in (PROJECT / folder).rglob("*.py")
        if re.search(r"FINGER_COLOURS\b[^\n]* = ", path.read_text(encoding="utf-8"))
    ]
    assert [path.name for path in sources] == ["figures.py"]
