"""What pages name is there: files, verbs, options, modules, extras, tests, numbers; ``make words`` runs this."""

from __future__ import annotations

import ast
import json
import re
import sys
import tomllib
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import click
import pytest

from reference.page_blocks import blocks_of, commands_of
from reference.tutorials import DOCS, PROJECT, TUTORIALS
from tega.arm import FRAMES, ArmSettings
from tega.ui.cli.guest_group import guest_verbs
from tega.ui.cli.main import _EARLIER, _VERBS, cli

EVIDENCE: Final = DOCS / "evidence"
PAGES: Final = sorted([*PROJECT.glob("*.md"), *DOCS.rglob("*.md")])
SCRIPTS: Final = [PROJECT / name for name in ("fuzz/README.md", "Makefile", ".ci/run", ".ci/extras")]

pytestmark = [
    pytest.mark.words,
    pytest.mark.skipif(not (PROJECT / "mkdocs.yml").is_file(), reason="not a checkout"),
]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_verbs_and_modules_a_page_names_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?:^|/|`|&& )tega-teleop ([a-z][a-z-]*)", text, re.MULTILINE)
    own = {"grip"} if page.name == "own-feature.md" else set()  # the example's
    earlier = set(_EARLIER) if page.name == "CHANGELOG.md" else set()
    assert set(named) <= {*_VERBS, *guest_verbs(), *earlier, *own}
    for name in re.findall(r"python -m (tega[\w.]*\w)", text):
        assert find_spec(name) is not None, name


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_every_option_that_a_page_shows_exists(page: Path) -> None:
    for words in commands_of(page):
        command: click.Command = cli
        for word in words:
            if not isinstance(command, click.Group):
                break
            if word.startswith("-"):
                continue
            inner = command.get_command(click.Context(command), word)
            if inner is None:
                assert command is not cli or not re.fullmatch(r"[a-z][a-z-]*", word), f"no verb {word}"
                break
            command = inner
        known = {o for c in (cli, command) for p in c.params for o in (*p.opts, *p.secondary_opts)}
        known |= {"-h", "--help"}
        for word in words:
            if re.fullmatch(r"--[a-z][a-z-]*", word):
                assert word in known, f"{page.name}: {' '.join(words)} has no option {word}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_every_extra_that_a_page_installs_exists(page: Path) -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pattern = r"pip install (?:-e )?'([\w.]+)\[([\w,-]+)\]'"
    for place, extras in re.findall(pattern, page.read_text(encoding="utf-8")):
        assert place == ".", f"{page.name}: there is no package {place} on an index; install '.[{extras}]'"
        assert set(extras.split(",")) <= set(project["optional-dependencies"])


def test_no_two_tutorials_write_the_same_name() -> None:
    """Nothing is written over, so a reader who types a second tutorial in the same folder would be stopped."""
    written: dict[str, set[str]] = {"results": {"what a run writes where nothing else is said"}}
    for page in (*TUTORIALS, DOCS / "replay.md"):
        text = "\n".join(
            b.text for b in blocks_of(page) if b.mark in {"", "background"} and b.language != "python"
        )
        for name in re.findall(r"""(?:--out |--record |out_dir ?= ?"?)([\w.-]+)""", text):
            # The emulated bench keeps what it needs in a folder of the settings' name.
            written.setdefault(name.removesuffix(".toml"), set()).add(page.stem)
    assert {name: pages for name, pages in written.items() if len(pages) > 1} == {}


@cache
def names_in(name: str) -> set[str] | None:
    """Return the tests of a file, by its path or by its name alone; ``None`` where there is no such file."""
    place = PROJECT / name
    found = [place] if place.is_file() else sorted((PROJECT / "tests").rglob(Path(name).name))
    nodes = [node for path in found for node in ast.parse(path.read_text(encoding="utf-8")).body]
    return {node.name for node in nodes if isinstance(node, ast.FunctionDef)} if found else None


@pytest.mark.parametrize("path", [*PAGES, *SCRIPTS], ids=lambda path: path.relative_to(PROJECT).as_posix())
def test_every_test_that_is_named_exists(path: Path) -> None:
    pattern = r"(?<![\w/])((?:tests/)?(?:[a-z_]+/)*test_\w+\.py)(?:::(test_\w+))?"
    for file, test in re.findall(pattern, path.read_text("utf-8")):
        found = names_in(file)
        assert found is not None, file
        assert not test or test in found, f"{file}::{test}"


# Their tests move the clock themselves, or read the emulated devices' stamps.
CLOCKS: Final = (
    "tests/hazards/test_times.py",
    "tests/hazards/test_device_times.py",
    "tests/hazards/test_stamps.py",
    "tests/hazards/test_letting_go.py",
    "tests/tega/unit/test_arm.py",
    "tests/tega/unit/test_repeats.py",
)


def test_every_hazard_names_tests_and_one_of_each_time_that_it_states() -> None:
    table = (EVIDENCE / "safety.md").read_text(encoding="utf-8").split("## What can go wrong", 1)[1]
    lines = [line for line in table.split("\n## ", 1)[0].splitlines() if line[:1] == "|"][2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len(rows) > 20
    for row in rows:
        assert len(row) == 5
        assert all(row)
        assert re.search(r"`tests/[\w/]+\.py::\w+`", row[4]), row[0]
        times = re.search(r"\d m?s\b", row[2])
        assert not times or any(f"`{module}::" in row[4] for module in CLOCKS), row[0]
    listed = " ".join(row[4] for row in rows)
    for path in sorted((PROJECT / "tests" / "hazards").glob("test_*.py")):
        for name in names_in(f"tests/hazards/{path.name}") or ():
            assert not name.startswith("test_") or f"{path.name}::{name}`" in listed


RECORDINGS: Final = re.compile(
    r"gsmini_|wedge_force|digit_disc_force|digit_grasp|ball presses|"
    r"my_thesis|recording_force_v|unibo_inail|gripping_force|longterm_myo|of public recordings"
)
"""What the recordings are called by pages that judge on them."""


@pytest.mark.parametrize(
    "page",
    [page for page in DOCS.rglob("*.md") if RECORDINGS.search(page.read_text("utf-8"))],
    ids=lambda p: p.stem,
)
def test_a_page_that_judges_on_recordings_labels_them_and_names_the_reader_s_own_command(page: Path) -> None:
    """A figure on the data that a constant was chosen on is no accuracy."""
    text = page.read_text("utf-8")
    if re.search(r"^\|.*\b0\.\d\d\b", text, re.MULTILINE):
        assert re.search(r"\bin-sample\b", text, re.IGNORECASE), "says of no figure that it is in-sample"
    assert "**Held-out**" in text, "has no held-out figure and does not say that there is none"
    assert re.search(r"tega-teleop (audit|emg compare|study score)\b", text), "names no command"


def test_the_arm_s_numbers_are_the_defaults() -> None:
    text, s = (EVIDENCE / "arm.md").read_text(encoding="utf-8"), ArmSettings()
    low, high = s.limits.low_m, s.limits.high_m
    for message in (
        f"x {low[0]:.2f} to {high[0]:.2f}, y ±{high[1]:.2f}, z {low[2]:.2f} to {high[2]:.2f} m; "
        f"{s.limits.tilt_rad} rad",
        f"{s.limits.ahead_m} m, {s.limits.ahead_rad} rad",
        f"{s.limits.speed_m_s} m/s, {s.limits.acceleration_m_s2:g} m/s²; {s.limits.turn_rad_s} rad/s, "
        f"{s.limits.turn_acceleration_rad_s2:g} rad/s²",
        f"{s.filter.cutoff_hz} Hz and {s.filter.beta_per_m:g} Hz per m/s; {s.filter.turn_cutoff_hz} Hz and "
        f"{s.filter.turn_beta_per_rad:g} Hz per rad/s; speeds {s.filter.speed_cutoff_hz:g} Hz",
        f"{s.gate.age_ms:g} ms; {s.gate.ahead_ms:g} ms ahead; {s.gate.step_m:.2f} m or {s.gate.step_rad} rad a step; "
        f"{s.gate.speed_m_s:g} m/s, {s.gate.turn_rad_s:g} rad/s",
    ):
        assert message in text, message
    assert all(f"| `{name}` |" in (DOCS / "arm.md").read_text(encoding="utf-8") for name in FRAMES)


@pytest.mark.parametrize(
    "path", sorted((PROJECT / "examples/notebooks").glob("*.ipynb")), ids=lambda p: p.stem
)
def test_a_notebook_holds_its_outputs_and_is_small(path: Path) -> None:
    cells = [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert any(cell["outputs"] for cell in cells)
    assert not any(one["output_type"] == "error" for cell in cells for one in cell["outputs"])
    assert path.stat().st_size < 100_000


def test_the_lift_of_the_first_page_is_below_three_megabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser", reason="needs the extra view")
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    from lift_player import TITLE, lift_page

    page = lift_page(DOCS / "lift.viser")
    assert len(page.encode()) < 3_000_000
    assert f"<title>{TITLE}</title>" in page
    assert page.index("window.__VISER_EMBED_DATA__=") < page.index("</head>")
    assert 'src="lift.html"' in (DOCS / "index.md").read_text(encoding="utf-8")
