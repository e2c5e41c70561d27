"""The template of a driver: installed as anybody's package, found by its entry points, through the contract."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
TEMPLATE = PROJECT / "examples" / "own_device"

pytestmark = pytest.mark.skipif(not TEMPLATE.is_dir(), reason="not a checkout")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install a copy into a folder of its own, without network, and return an environment that sees it."""
    try:
        fits = tuple(map(int, version("setuptools").split(".")[:2])) >= (70, 1)
    except PackageNotFoundError:
        fits = False
    if not fits:
        pytest.skip("setuptools 70.1 or later, which builds the template, is not installed")
    place = tmp_path_factory.mktemp("site")
    copy = tmp_path_factory.mktemp("copy") / "own_device"
    for file in TEMPLATE.rglob("*"):
        if file.suffix in {".py", ".toml"}:
            (copy / file.relative_to(TEMPLATE)).parent.mkdir(parents=True, exist_ok=True)
            (copy / file.relative_to(TEMPLATE)).write_bytes(file.read_bytes())
    words = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-index",
        "--no-deps",
        "--no-build-isolation",
    ]
    done = subprocess.run(
        [*words, "--target", str(place), str(copy)], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return {**os.environ, "PYTHONPATH": str(place)}


def run(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words], check=False, capture_output=True, text=True, env=environment
    )


@pytest.mark.slow
def test_the_template_passes_the_contract(installed: dict[str, str]) -> None:
    done = run(installed, "-m", "tega.setup.contract", "own-emg", "own-vest")
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line.split()[:2] for line in done.stdout.splitlines()] == [["ok", "own-emg"], ["ok", "own-vest"]]
    listed = run(installed, "-m", "tega.ui.cli", "devices")
    assert "own-emg" in listed.stdout
    assert "template of a vest" in listed.stdout
    done = run(installed, "-m", "tega.setup.contract", "own-emg", "--set", "port=broken")
    assert done.returncode == 2
    assert "is it switched on?" in done.stdout


CLOSED = 'raise DeviceUnavailableError("own-emg is not open", "open it first")'
LIMITED = "np.minimum(frame.intensities, self._options.limit)"
BREAKING = [
    ("emg", CLOSED, "return None", "while closed raises"),
    (
        "emg",
        "samples = self._received(self._opened_ns)",
        "samples = np.zeros((1, 9))",
        "one column per channel",
    ),
    ("emg", "self._n_delivered += len(samples)", "pass", "first_index never goes back"),
    ("vest", LIMITED, "(frame.intensities + 1)", "only ever lowers"),
    ("vest", LIMITED, "nothing", "it raised NameError"),
]


@pytest.mark.parametrize(("module", "right", "wrong", "rule"), BREAKING)
def test_the_contract_finds_what_is_wrong_with_it(
    installed: dict[str, str], tmp_path: Path, module: str, right: str, wrong: str, rule: str
) -> None:
    place = Path(installed["PYTHONPATH"])
    for file in place.rglob("*"):
        if file.is_file() and "__pycache__" not in file.parts:
            (tmp_path / file.relative_to(place)).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file.relative_to(place)).write_bytes(file.read_bytes())
    source = tmp_path / "own_device" / f"{module}.py"
    text = source.read_text(encoding="utf-8")
    assert right in text
    source.write_text(text.replace(right, wrong), encoding="utf-8")
    done = run({**installed, "PYTHONPATH": str(tmp_path)}, "-m", "tega.setup.contract", f"own-{module}")
    assert done.returncode == 1, done.stdout + done.stderr
    assert done.stdout.startswith("broken")
    assert rule in done.stdout


def test_the_page_shows_commands_that_exist() -> None:
    page = (PROJECT / "docs" / "own-device.md").read_text(encoding="utf-8")
    for file in re.findall(r"examples/own_device[\w/.-]*", page):
        assert (PROJECT / file).exists(), file
    assert "python -m tega.setup.contract own-emg own-vest" in page
