"""Stages of one's own: four example packages, installed as anybody's, put through the contract and used in a run."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
EXAMPLES = {
    "own_metric": "embedding",
    "own_decoder": "one-channel",
    "own_mapping": "bars",
    "own_layout": "sleeve16",
}

pytestmark = pytest.mark.skipif(not (PROJECT / "examples" / "own_metric").is_dir(), reason="not a checkout")

RUN = """
import json, sys
from collections import Counter
from pathlib import Path
from tega.config import load_config
from tega.recording.mcap_reader import McapReader
from tega.replay import replay_file
from tega.teleop import run_session

folder = Path(sys.argv[1])
summary = run_session(load_config(folder / "lab.toml", environ={}).config)
file = folder / "recorded" / summary["recording"]["file"]
reader = McapReader(file)
more, closures, commands, vest = Counter(), set(), set(), Counter()
for message in reader.messages():
    value = message.value
    if message.topic == "/tactile/index/contact":
        more.update({(one.name, one.unit): abs(one.value) > 0 for one in value.more})
    elif message.topic == "/emg/levels":
        closures.add(value.closure)
    elif message.topic == "/hand/frames" and value.HasField("closure"):
        commands.add(value.closure)
    elif message.topic == "/vest/frame":
        vest[value.layout, len(value.intensities), max(value.intensities) > 0] += 1
print(json.dumps({
    "more": [[*key, n] for key, n in sorted(more.items())],
    "closures": len(closures), "between": len([c for c in closures if 0 < c < 1]),
    "range": [min(closures), max(closures)],
    "commands": len(commands), "vest": [[*key, n] for key, n in vest.items()],
    "toml": reader.files["session.toml"].decode(),
    "same": replay_file(file).same,
}))
"""

LAB = """
[session]
preset = "live"
pace = "fast"
duration_s = 4.0
[tactile.index]
driver = "synthetic-touch"
[emg]
driver = "synthetic-emg"
kind = "raw"
[stages.metric]
name = "embedding"
options = { components = 2 }
[stages.decoder]
name = "one-channel"
options = { channel = 2 }
[stages.mapping]
name = "bars"
[vest]
layout = "sleeve16"
[recording]
dir = "recorded"
lossless = true
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install copies into a folder of their own, without network, and return an environment that sees it."""
    try:
        fits = tuple(map(int, version("setuptools").split(".")[:2])) >= (70, 1)
    except PackageNotFoundError:
        fits = False
    if not fits:
        pytest.skip("setuptools 70.1 or later, which builds the examples, is not installed")
    place = tmp_path_factory.mktemp("site")
    words = ["-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target"]
    for name in EXAMPLES:
        copy = tmp_path_factory.mktemp("copy") / name
        for file in (PROJECT / "examples" / name).rglob("*"):
            if file.suffix in {".py", ".toml"}:
                (copy / file.relative_to(PROJECT / "examples" / name)).parent.mkdir(
                    parents=True, exist_ok=True
                )
                (copy / file.relative_to(PROJECT / "examples" / name)).write_bytes(file.read_bytes())
        done = run(dict(os.environ), *words, str(place), str(copy))
        assert done.returncode == 0, done.stderr
    return {**os.environ, "PYTHONPATH": str(place)}


def run(
    environment: dict[str, str], *words: str, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words], check=False, capture_output=True, text=True, env=environment, cwd=cwd
    )


def test_the_examples_pass_the_contract_and_are_listed(installed: dict[str, str]) -> None:
    done = run(installed, "-m", "tega.testing.contract", *EXAMPLES.values())
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line.split()[:2] for line in done.stdout.splitlines()] == [["ok", n] for n in EXAMPLES.values()]
    listed = json.loads(run(installed, "-m", "tega.cli", "stages", "--json").stdout)
    own = {stage["name"]: stage for stage in listed if stage["package"] != "tega"}
    assert set(own) == set(EXAMPLES.values())
    assert own["embedding"]["values"] == {"pc1": "grey", "pc2": "grey", "pc3": "grey"}
    done = run(installed, "-m", "tega.testing.contract", "one-channel", "--set", "rest=0.9")
    assert done.returncode == 2, done.stdout
    assert "a rest below full" in done.stdout


def test_the_examples_run_in_a_session_and_are_recorded(installed: dict[str, str], tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    (tmp_path / "lab.toml").write_text(LAB)
    done = run(installed, "-c", RUN, str(tmp_path))
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert [row[:2] for row in told["more"]] == [["pc1", "grey"], ["pc2", "grey"]]
    assert all(n > 10 for *_, n in told["more"])
    # The hand was told closures between the levels, as many as the decoder gave.
    assert told["closures"] > 20
    assert told["between"] > 10
    assert 0 <= told["range"][0] < 0.2 < told["range"][1] <= 1
    assert told["commands"] > 10
    assert {tuple(row[:2]) for row in told["vest"]} == {("sleeve16", 16)}
    assert any(lit for _, _, lit, _ in told["vest"])
    assert 'name = "embedding"' in told["toml"]
    assert told["same"]


def test_without_its_package_a_recording_says_what_is_missing(
    installed: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "lab.toml").write_text(LAB)
    alone = {name: value for name, value in installed.items() if name != "PYTHONPATH"}
    done = run(alone, "-m", "tega.cli", "config", "check", "lab.toml", cwd=tmp_path)
    assert done.returncode == 1
    assert "stages.metric.name: no metric is called 'embedding'" in done.stderr


BREAKING = [
    ("own_metric", "finger=self._setup.finger", 'finger="thumb"', "finger is the one it was made for"),
    ("own_metric", 'return {f"pc{number}"', 'return {f"p{number}"', "more holds every value of units"),
    ("own_decoder", "self._n += len(samples)", "pass", "however the samples are cut"),
    ("own_decoder", "closure=closure", "closure=2 * closure", "closure is 0 to 1"),
    ("own_mapping", "return levels", "return levels + 1", "every motor rests"),
    ("own_layout", "SPACING_MM * row)", "SPACING_MM * row) if row else None", "are known, or none"),
]


@pytest.mark.parametrize(("package", "right", "wrong", "rule"), BREAKING)
def test_the_contract_finds_what_is_wrong(
    installed: dict[str, str], tmp_path: Path, package: str, right: str, wrong: str, rule: str
) -> None:
    place = Path(installed["PYTHONPATH"])
    for file in place.rglob("*"):
        if file.is_file() and "__pycache__" not in file.parts:
            (tmp_path / file.relative_to(place)).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file.relative_to(place)).write_bytes(file.read_bytes())
    source = tmp_path / package / "__init__.py"
    before = source.read_text()
    assert right in before
    source.write_text(before.replace(right, wrong))
    done = run({**installed, "PYTHONPATH": str(tmp_path)}, "-m", "tega.testing.contract", EXAMPLES[package])
    assert done.returncode == 1, done.stdout + done.stderr
    assert rule in done.stdout


def test_the_examples_import_nothing_private() -> None:
    for name in EXAMPLES:
        for file in (PROJECT / "examples" / name).rglob("*.py"):
            imported = re.findall(r"^(?:from|import) (tega[\w.]*)(?: import (.+))?", file.read_text(), re.M)
            for module, names in imported:
                assert module in {"tega.stages", "tega.tactile", "tega.emg", "tega.errors"}, module
                assert not re.search(r"\b_", names), names


def test_the_page_names_files_that_are_there() -> None:
    page = (PROJECT / "docs" / "own-stage.md").read_text(encoding="utf-8")
    for file in re.findall(r"examples/own_(?:metric|decoder|mapping|layout)[\w/.-]*", page):
        assert (PROJECT / file).exists(), file
    assert all(name in page and stage in page for name, stage in EXAMPLES.items())
