"""What documents show as Python runs as it stands, docstrings and pages alike."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

import tega
import tega_campaigns
import tega_emulators
import tega_figures
from tega_sim.world import read_objects

PROJECT = Path(__file__).resolve().parents[2]
# Modules whose import needs an optional package do so inside functions, so that all can be walked.
MODULES = sorted(
    m.name
    for package in (tega, tega_emulators, tega_campaigns, tega_figures)
    for m in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    if not m.name.endswith("__main__")
)

pytestmark = pytest.mark.skipif(not (PROJECT / "README.md").is_file(), reason="not a checkout")


def has_example(name: str) -> bool:
    """Whether a module's source shows a session of Python."""
    spec = find_spec(name)
    return bool(
        spec
        and spec.origin
        and spec.origin.endswith(".py")
        and ">>> " in Path(spec.origin).read_text("utf-8")
    )


@pytest.mark.parametrize("name", [name for name in MODULES if has_example(name)])
def test_examples_in_docstrings_run(name: str) -> None:
    done = doctest.testmod(importlib.import_module(name))
    assert done.failed == 0
    assert done.attempted > 0


def test_every_module_can_be_imported() -> None:
    for name in MODULES:
        if name == "tega_emulators.bluez_vest" and find_spec("dbus_fast") is None:
            continue  # comes with bleak on Linux only
        importlib.import_module(name)


def blocks(page: str, language: str) -> list[str]:
    """Return the blocks of a page in a language."""
    text = (PROJECT / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


@pytest.mark.parametrize("page", ["README.md", "docs/arm.md", "docs/evidence/sim.md"])
def test_a_page_s_python_runs(page: str) -> None:
    code = blocks(page, "python")
    names: dict[str, object] = {}
    for block in code[:1] if page == "README.md" else code:  # its second one needs devices
        exec(compile(block, page, "exec"), names)
    if page == "README.md":
        assert isinstance(names["packet"], bytes)
        assert len(names["packet"]) == 20
    elif page == "docs/arm.md":
        assert getattr(names["command"], "state", "") == "idle"
    else:
        assert getattr(names["emg_uv"], "shape", None) == (10, 3)


def test_the_object_of_a_page_can_be_read(tmp_path: Path) -> None:
    (text,) = blocks("docs/evidence/sim.md", "toml")
    (tmp_path / "things.toml").write_text(text, encoding="utf-8")
    assert list(read_objects(tmp_path / "things.toml")) == ["tin"]
