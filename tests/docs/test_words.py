"""Pages keep to the glossary, spell terms out, link what they name, and stay short. `make lint` runs this file."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
DOCS = PROJECT / "docs"

pytestmark = pytest.mark.skipif(not DOCS.is_dir(), reason="not a checkout")
if DOCS.is_dir():
    from reference.site_pages import evidence_pages, user_pages
else:  # pragma: no cover  # an installed package has no pages

    def user_pages() -> list[Path]:
        """Return nothing: there are no pages."""
        return []

    evidence_pages = user_pages


def _prose(page: Path) -> str:
    """Return a page without code blocks and link targets."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"\]\([^)]*\)", "]", text)


def _retired() -> list[str]:
    """Read the first column of the glossary's last table."""
    table = (DOCS / "glossary.md").read_text(encoding="utf-8").split("## Words that are not used")[1]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")][2:]
    return [word.strip() for cell in cells for word in cell.split(",")]


def retired_in(text: str) -> list[str]:
    """Return the retired words that a text has."""
    words = "|".join(re.escape(word).replace(r"\ ", r"[\s-]+") for word in _retired())
    return [m.group() for m in re.finditer(rf"\b(?:{words})s?\b", text, re.IGNORECASE)]


def test_the_glossary_names_what_is_retired() -> None:
    assert retired_in("The mock\ndevice shows the grip-level of a human subject") == [
        "mock\ndevice",
        "grip-level",
        "human subject",
    ]
    assert retired_in("The emulated device shows the level; subject to change") == []


@pytest.mark.parametrize("page", user_pages(), ids=lambda p: p.name)
def test_a_page_has_no_retired_word(page: Path) -> None:
    text = _prose(page)
    if page.name == "glossary.md":
        text = text.split("## Words that are not used")[0]
    assert retired_in(text) == []


@pytest.mark.parametrize(
    "file",
    sorted([*(PROJECT / "python/tega/ui/cli").rglob("*.py"), *(PROJECT / "tools").rglob("command.py")]),
    ids=lambda p: f"{p.parent.name}/{p.name}",
)
def test_help_and_messages_have_no_retired_word(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    said = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    assert retired_in("\n".join(said)) == []


@pytest.mark.parametrize("page", user_pages(), ids=lambda p: p.name)
@pytest.mark.parametrize(
    ("short", "spelt"), [("CCI", "contact concentration index"), ("EDA", "effective deformation area")]
)
def test_cci_and_eda_are_spelt_out_where_a_page_first_uses_them(page: Path, short: str, spelt: str) -> None:
    text = _prose(page)
    first = re.search(rf"\b{short}\b", text)
    if first:
        near = re.sub(r"\s+|\*", " ", text[: first.end() + 60]).lower()
        assert spelt in re.sub(" +", " ", near), f"{page.name} uses {short} before it says {spelt}"


@pytest.mark.parametrize("page", user_pages(), ids=lambda p: p.name)
def test_a_numbered_reading_is_explained_where_it_is_named(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for number in re.findall(r"\breadings? ((?:A\d+(?:, | and | to )?)+)", text):
        for name in re.findall(r"A\d+", number):
            explained = re.search(rf"\*\*{name}\*\*|readings\.md#{name.lower()}\b", text)
            assert explained, f"{page.name} names reading {name} and does not explain it"


@pytest.mark.parametrize("page", user_pages(), ids=lambda p: p.name)
def test_a_user_page_names_no_test_and_no_load(page: Path) -> None:
    named = re.findall(r"tests/[\w/]+\.py|`test_\w+`|load average", page.read_text(encoding="utf-8"))
    assert named == []


LONGEST = 1200


def n_words(page: Path) -> int:
    """Count the words that people wrote: a table between ``begin`` and ``end`` comments is a program's.

    Reference pages of verbs, settings, drivers, stages and Python are made by ``docs/reference_pages.py`` when the
    site is built; no file holds them, so they do not count either.
    """
    text = page.read_text(encoding="utf-8")
    return len(re.sub(r"<!-- (\w+): begin -->.*?<!-- \1: end -->", "", text, flags=re.DOTALL).split())


@pytest.mark.parametrize("page", user_pages(), ids=lambda p: p.name)
def test_a_user_page_is_short(page: Path) -> None:
    assert n_words(page) <= LONGEST


def test_every_page_is_either_taught_or_proven() -> None:
    pages = {p.resolve() for p in DOCS.rglob("*.md")}
    listed = [p.resolve() for p in (*user_pages(), *evidence_pages())]
    assert len(listed) == len(set(listed))
    assert pages <= set(listed)
