"""The public interface is the one that is written down."""

from __future__ import annotations

import difflib
from pathlib import Path

import pytest

from tega_figures.public import public_text

SNAPSHOT = Path(__file__).resolve().parents[2] / "docs" / "public.txt"


@pytest.mark.words
@pytest.mark.skipif(not SNAPSHOT.is_file(), reason="not a checkout")
def test_the_public_interface_is_the_one_that_is_written_down() -> None:
    before, now = SNAPSHOT.read_text(encoding="utf-8"), public_text()
    changed = "\n".join(
        difflib.unified_diff(before.splitlines(), now.splitlines(), "written", "now", n=0, lineterm="")
    )
    assert not changed, (
        f"{changed}\nif that is meant: python tools/figures/tega_figures/public.py docs/public.txt, and a line of "
        "migration in changes/"
    )
