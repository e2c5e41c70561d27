"""The page on objects shows the kept feasibility map, and its file of an object can be read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tega_sim.world import read_objects

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "sim.md"

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def test_the_page_s_object_can_be_read(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "things.toml"
    path.write_text(text, encoding="utf-8")
    assert list(read_objects(path)) == ["tin"]
