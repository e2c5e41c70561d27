"""What documents show runs as it stands: docstrings, the Python of pages, notebooks, tutorials, the site's search."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import can
import pytest

import tega
import tega_campaigns
import tega_emulators
import tega_figures
from reference.chromium import launched
from reference.installed import program
from reference.page_blocks import blocks_of
from reference.tutorials import DOCS, PROJECT, REHEARSAL, TUTORIALS, run_tutorial
from tega.hand import CLOSURE_POSES_RAD
from tega.wire import allegro_position_frames
from tega_figures.public import PUBLIC
from tega_sim.world import read_objects

NOTEBOOKS = PROJECT / "examples" / "notebooks"
# Modules whose import needs an optional package do so inside functions, so that all can be walked.
MODULES = sorted(
    m.name
    for package in (tega, tega_emulators, tega_campaigns, tega_figures)
    for m in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    if not m.name.endswith("__main__")
)
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

pytestmark = pytest.mark.skipif(not (PROJECT / "README.md").is_file(), reason="not a checkout")


def has_example(name: str) -> bool:
    spec = find_spec(name)
    is_source = spec and spec.origin and spec.origin.endswith(".py")
    return bool(is_source and spec and ">>> " in Path(str(spec.origin)).read_text("utf-8"))


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


def python_of(page: str, n: int | None = None) -> dict[str, object]:
    """Run a page's Python, or its first blocks, and return the names that it leaves."""
    names: dict[str, object] = {}
    blocks = [block.text for block in blocks_of(PROJECT / page) if block.language == "python"]
    assert blocks
    for block in blocks[:n]:
        exec(compile(block, page, "exec"), names)
    return names


def test_a_page_s_python_runs() -> None:
    packet = python_of("README.md", 1)["packet"]  # its second block needs devices
    assert isinstance(packet, bytes)
    assert len(packet) == 20
    assert getattr(python_of("docs/arm.md")["command"], "state", "") == "idle"
    assert getattr(python_of("docs/emg.md")["levels"], "shape", None) == (40,)
    assert getattr(python_of("docs/evidence/sim.md")["emg_uv"], "shape", None) == (10, 3)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["docs/library.md", "README.md"])
def test_the_python_of_a_page_runs_on_devices(tmp_path, monkeypatch, page, capsys):
    pytest.importorskip("matplotlib").use("Agg")
    import matplotlib.pyplot as plt

    (tmp_path / "lab.toml").write_text(LAB)
    (tmp_path / "examples").symlink_to(PROJECT / "examples")
    monkeypatch.chdir(tmp_path)
    python_of(page)
    plt.close("all")
    assert re.search(r"\d\.\d\d s, thumb: ", capsys.readouterr().out)


def test_the_code_of_a_page_reads_a_log_of_python_can(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with can.CanutilsLogWriter("candump.log") as log:
        for frame in allegro_position_frames(CLOSURE_POSES_RAD[2]):
            log(can.Message(1.0, arbitration_id=frame.id, data=frame.data, is_extended_id=False))
    python_of("docs/device-allegro.md")
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in printed] == ["index", "middle", "ring", "thumb"]
    assert printed[-1] == "1.0 thumb [1.34999889 0.24995706 0.30001948 0.50000288]"


def test_the_object_of_a_page_can_be_read(tmp_path: Path) -> None:
    (text,) = [b.text for b in blocks_of(DOCS / "evidence/sim.md") if b.language == "toml"]
    (tmp_path / "things.toml").write_text(text, encoding="utf-8")
    assert list(read_objects(tmp_path / "things.toml")) == ["tin"]


@pytest.mark.slow
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


@pytest.mark.slow
def test_the_notebooks_run() -> None:
    words = ["-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider", "-p", "nbmake", "--nbmake"]
    notebooks = [NOTEBOOKS / f"{name}.ipynb" for name in ("equations", "recording", "decoders")]
    assert "3 passed" in program(sys.executable, *words, *notebooks).stdout


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", [p for p in TUTORIALS if p != REHEARSAL], ids=lambda p: p.stem)
def test_a_tutorial_runs_as_written(page: Path, tmp_path: Path) -> None:
    run_tutorial(page, tmp_path)


@pytest.mark.slow
def test_a_page_from_the_disk_has_a_worker_for_its_search(tmp_path: Path) -> None:
    (tmp_path / "twice.js").write_text('addEventListener("message", (asked) => postMessage(2 * asked.data));')
    (tmp_path / "page.html").write_text(
        '<body><script src="file-worker.js"></script><script>const worker = new Worker("twice.js");'
        'worker.addEventListener("message", (told) => { document.title = told.data; });'
        "worker.postMessage(21);</script>"
    )
    shutil.copy(DOCS / "file-worker.js", tmp_path)
    with launched() as browser:
        displayed = browser.new_page()
        displayed.goto((tmp_path / "page.html").as_uri())
        displayed.wait_for_function("document.title === '42'", timeout=60_000)
