"""The page of the simulated bench has examples that run, and its tables and picture can be made."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from tega_figures.simulated_person import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "sim.md"

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def test_the_page_s_python_runs() -> None:
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, PAGE.name, "exec"), names)
    assert getattr(names["emg_uv"], "shape", None) == (10, 3)


def test_the_holds_are_printed_as_a_table() -> None:
    printed = CliRunner().invoke(main, ["holds", "--holds", "1"])
    assert printed.exit_code == 0
    assert len(printed.output.splitlines()) == 10


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    assert CliRunner().invoke(main, ["picture", str(tmp_path / "emg.png")]).exit_code == 0
    assert (tmp_path / "emg.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
