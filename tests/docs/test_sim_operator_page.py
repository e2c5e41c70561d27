"""The page of the simulated bench has examples that run, and its tables and picture can be made."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "sim.md"

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def test_the_page_s_python_runs() -> None:
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, PAGE.name, "exec"), names)
    assert getattr(names["emg_uv"], "shape", None) == (10, 3)
