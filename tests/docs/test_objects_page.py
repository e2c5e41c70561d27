"""The page on objects shows the kept feasibility map, and its file of an object can be read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import tega_figures.world
from tega_figures.world.feasible import main
from tega_sim.world import read_objects

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "objects.md"
MAP = Path(tega_figures.world.__file__).with_name("feasible.json")

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def test_the_page_shows_the_table_of_the_kept_map() -> None:
    printed = CliRunner().invoke(main, ["table", str(MAP)])
    assert printed.exit_code == 0
    assert printed.output.strip() in PAGE.read_text(encoding="utf-8")


def test_the_page_s_object_can_be_read(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "things.toml"
    path.write_text(text, encoding="utf-8")
    assert list(read_objects(path)) == ["tin"]


def test_the_map_s_picture_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    assert CliRunner().invoke(main, ["picture", str(MAP), str(tmp_path / "map.png")]).exit_code == 0
    assert (tmp_path / "map.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
