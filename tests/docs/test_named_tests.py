"""Find every test that a page, a script of CI or the Makefile names."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
NAMED = re.compile(r"(?<![\w/])((?:tests/)?(?:[a-z_]+/)*test_\w+\.py)(?:::(test_\w+))?")

pytestmark = pytest.mark.skipif(not (PROJECT / "mkdocs.yml").is_file(), reason="not a checkout")


def texts() -> list[Path]:
    named = [
        PROJECT / name
        for name in ("README.md", "CONTRIBUTING.md", "fuzz/README.md", "Makefile", ".ci/run", ".ci/extras")
    ]
    return [path for path in named if path.is_file()] + sorted((PROJECT / "docs").rglob("*.md"))


@cache
def source_of(name: str) -> str | None:
    """Return the text of a test's file: by its path, or by its name alone; ``None`` where there is none."""
    place = PROJECT / name
    found = [place] if place.is_file() else sorted((PROJECT / "tests").rglob(Path(name).name))
    return "\n".join(path.read_text(encoding="utf-8") for path in found) or None


def missing(text: str) -> list[str]:
    gone = []
    for file, test in NAMED.findall(text):
        source = source_of(file)
        if source is None or (test and not re.search(rf"\bdef {test}\b", source)):
            gone.append(f"{file}::{test}" if test else file)
    return gone


@pytest.mark.parametrize("path", texts(), ids=lambda path: path.relative_to(PROJECT).as_posix())
def test_every_test_that_is_named_exists(path: Path) -> None:
    assert missing(path.read_text(encoding="utf-8")) == []


def test_a_test_that_is_gone_is_found() -> None:
    assert missing("`tests/docs/test_named_tests.py::test_gone`") == [
        "tests/docs/test_named_tests.py::test_gone"
    ]
    assert missing("run test_nowhere.py") == ["test_nowhere.py"]
