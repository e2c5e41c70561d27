"""The Python of the library's page and of the README runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

import tega
from tega_figures.public import PUBLIC

PROJECT = Path(__file__).resolve().parents[2]
LAB = """
[session]
pace = "real"

[tactile.thumb]
driver = "synthetic-touch"
options = { duration_s = 4.0 }

[emg]
driver = "synthetic-emg"
kind = "raw"
options = { duration_s = 4.0 }

[vest]
driver = "vest-recorder"
options = { file = "vest.csv" }

[hand]
driver = "can-recorder"
options = { file = "can.csv" }
"""

pytestmark = [
    pytest.mark.skipif(not (PROJECT / "README.md").is_file(), reason="not a checkout"),
    pytest.mark.slow,
]


def python(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (PROJECT / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with settings and the example recording."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    (tmp_path / "lab.toml").write_text(LAB)
    (tmp_path / "examples").symlink_to(PROJECT / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", ["docs/library.md", "README.md"])
def test_the_python_of_a_page_runs(lab: Path, page: str, capsys: pytest.CaptureFixture[str]) -> None:  # noqa: ARG001
    names: dict[str, object] = {}
    blocks = python(page)
    assert len(blocks) >= 2
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    text = capsys.readouterr().out
    assert re.search(r"\d\.\d\d s, thumb: ", text)
    import matplotlib.pyplot as plt

    plt.close("all")


def test_the_library_s_names_are_the_reference_s() -> None:
    listed = (PROJECT / "docs" / "public.txt").read_text(encoding="utf-8")
    own = re.search(r"^tega\n(.*?)\n\n", listed, re.DOTALL | re.MULTILINE)
    assert own is not None
    names = {
        re.split(r"[(:]", line.strip().removeprefix("module ").removeprefix("def "))[0]
        for line in own[1].splitlines()
    }
    assert names == set(tega.__all__)
    for name in tega.__all__:
        assert getattr(tega, name) is not None
    stub = (Path(tega.__file__).parent / "__init__.pyi").read_text(encoding="utf-8")
    assert set(re.findall(r'^    "(\w+)",$', stub, re.MULTILINE)) == set(tega.__all__)
    assert {"tega.plot", "tega.recording.opened", "tega.loop.program"} <= set(PUBLIC)
    modules = {name for name in tega.__all__ if isinstance(getattr(tega, name), ModuleType)}
    assert modules == {
        name.removeprefix("tega.") for name in PUBLIC if name.count(".") == 1 and name.startswith("tega.")
    }
