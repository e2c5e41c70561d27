"""Documents keep their promises: examples run, links lead somewhere, verbs exist."""

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
from tega.ui.cli.guest_group import guest_verbs
from tega.ui.cli.main import _EARLIER, _VERBS

PROJECT = Path(__file__).resolve().parents[2]
PAGES = sorted([*PROJECT.glob("*.md"), *(PROJECT / "docs").rglob("*.md")])
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


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_verbs_a_page_names_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?:^|/|`|&& )tega-teleop ([a-z][a-z-]*)", text, re.MULTILINE)
    own = {"grip"} if page.name == "own-feature.md" else set()  # the example's
    earlier = set(_EARLIER) if page.name == "CHANGELOG.md" else set()
    assert set(named) <= {*_VERBS, *guest_verbs(), *earlier, *own}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_modules_a_page_runs_exist(page: Path) -> None:
    for name in re.findall(r"python -m (tega[\w.]*\w)", page.read_text(encoding="utf-8")):
        assert find_spec(name) is not None, name


def test_the_readme_s_python_runs() -> None:
    text = (PROJECT / "README.md").read_text(encoding="utf-8")
    code, _ = re.findall(r"```python\n(.*?)```", text, re.DOTALL)  # the second one needs devices
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert isinstance(names["packet"], bytes)
    assert len(names["packet"]) == 20
