"""Every picture of the docs is made again by a verb of the Makefile, and shown by a page."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
IMAGES = PROJECT / "docs" / "images"
MAKEFILE = PROJECT / "Makefile"

pytestmark = pytest.mark.skipif(not MAKEFILE.is_file(), reason="not a checkout")
PICTURES = sorted(path.name for path in IMAGES.glob("*.*") if path.suffix != ".py")


def scripts() -> dict[str, str]:
    """Return the source of each script that a verb runs, what it imports of the figures' package included, by name."""
    made = MAKEFILE.read_text(encoding="utf-8")
    files = [PROJECT / name for name in re.findall(r"python (\S+\.py)", made)]
    for name in re.findall(r"-m (tega_figures\S+)", made):
        spec = find_spec(name)
        assert spec is not None, f"make runs {name}, which is no module"
        assert spec.origin is not None
        files.append(Path(spec.origin))
    texts = {}
    for file in files:
        text = file.read_text(encoding="utf-8")
        for name in re.findall(r"from (tega_figures\S*) import", text):
            spec = find_spec(name)
            assert spec is not None
            assert spec.origin is not None
            text += Path(spec.origin).read_text(encoding="utf-8")
        texts[file.name] = text
    return texts


@pytest.fixture(scope="module")
def named() -> str:
    """Return the Makefile and the scripts that it runs, as one text."""
    return MAKEFILE.read_text(encoding="utf-8") + "".join(scripts().values())


@pytest.mark.parametrize("name", PICTURES)
def test_a_verb_makes_the_picture(name: str, named: str) -> None:
    stem, ending = name.rsplit(".", 1)
    whole = rf"""(?:["'/\s]|^){re.escape(stem)}(?:\.{ending}|(?=["']))"""
    assert re.search(whole, named, re.MULTILINE), f"no verb of the Makefile makes docs/images/{name}"


@pytest.mark.parametrize("name", PICTURES)
def test_a_page_shows_the_picture(name: str) -> None:
    pages = [*PROJECT.glob("*.md"), *(PROJECT / "docs").rglob("*.md")]
    assert any(f"images/{name})" in page.read_text(encoding="utf-8") for page in pages)
