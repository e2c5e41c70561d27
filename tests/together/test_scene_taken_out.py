"""Scene cameras are taken out of an installation: the rest works, and a recording made with them names the package."""

from __future__ import annotations

import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest

from reference.installed import distribution, program
from reference.played import muscles
from tega.config import check_tree
from tega.loop import run_session

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux"),
]

MISSING = "recorded with the feature 'scene', which is not installed here"
INSTALL = "pip install 'tega[lab]'"
Teleop = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make an environment with the packages of this one, but for the scene cameras and their entry points."""
    folder = tmp_path_factory.mktemp("installed") / "env"
    venv.create(folder, symlinks=True, with_pip=False)
    into = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)}))
    for path in map(Path, sys.path):
        if path.name in {"site-packages", "dist-packages"} and path.is_dir():
            for entry in path.iterdir():
                if not entry.name.startswith(("tega", "_tega", "__editable__")) and entry.suffix != ".pth":
                    link = into / entry.name
                    if not link.exists():
                        link.symlink_to(entry)
    tega = importlib.metadata.distribution("tega")
    for name in {"tega", *(one.module.partition(".")[0] for one in tega.entry_points)} - {"tega_scene"}:
        spec = find_spec(name)
        assert spec is not None
        assert spec.submodule_search_locations
        source = next(iter(spec.submodule_search_locations))
        shutil.copytree(source, into / name, ignore=shutil.ignore_patterns("__pycache__"))
    entries = (tega.read_text("entry_points.txt") or "").splitlines()
    left = [line for line in entries if not re.search(r"=\s*tega_scene\b", line)]
    assert len(left) < len(entries)
    distribution(into, "tega", "\n".join(left))
    return folder / "bin" / "python"


@pytest.fixture
def teleop(python: Path, tmp_path: Path) -> Teleop:
    return partial(program, python, "-P", "-m", "tega.ui.cli", folder=tmp_path)


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filmed")
    film = cv2.VideoWriter(str(folder / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 20, (96, 64))
    for number in range(20):
        film.write(np.full((64, 96, 3), 40 + 5 * number, np.uint8))
    film.release()
    tree = {
        "session": {"pace": "real", "duration_s": 1.0},
        "emg": muscles(1.0),
        "recording": {"dir": str(folder / "session"), "stop_free_mib": 0.0},
        "scene": [{"name": "front", "source": "film.avi", "width": 96, "height": 64, "rate_hz": 20.0}],
    }
    summary = run_session(check_tree(tree, {}, base=folder).config)
    assert summary["recording"]["written"]["/scene/front/video"] > 0
    return folder / "session"


def test_a_recording_with_its_video_opens_and_names_the_package(teleop: Teleop, filmed: Path) -> None:
    for verb in (("recording", "inspect"), ("verify",)):
        message = " ".join(teleop(*verb, str(filmed)).stdout.split())
        assert MISSING in message
        assert INSTALL in message
    assert json.loads(teleop("recording", "inspect", str(filmed), "--json").stdout)[0]["absent"]
    refused = teleop("recording", "export", str(filmed), "--format", "lerobot", "--out", "set", code=3)
    assert "tega_scene" in refused.stderr


def test_settings_with_its_table_are_refused_by_name(teleop: Teleop, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text('[[scene]]\nname = "front"\nsource = "a.avi"\n', encoding="utf-8")
    message = teleop("run", "lab.toml", code=1).stderr
    assert "lab.toml: scene: unknown key" in message
    assert "if this is a feature's table, install its package; else did" in message
