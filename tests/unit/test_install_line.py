"""The pip line of a hint works where the program was installed from."""

from __future__ import annotations

import json
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest

from tega.cli.install_line import with_origin

HINT = "install it with: pip install 'tega[sim,view]'"


def installed(folder: Path, url: str | None) -> PathDistribution:
    """Write what pip writes of an installed package."""
    place = folder / "tega-0.1.0.dist-info"
    place.mkdir()
    if url is not None:
        (place / "direct_url.json").write_text(json.dumps({"url": url, "dir_info": {}}), encoding="utf-8")
    return PathDistribution(place)


@pytest.mark.parametrize(
    ("url", "line"),
    [
        ("file:///home/a%20lab/tega", "pip install '/home/a lab/tega[sim,view]'"),
        ("file:///dist/tega-0.1.0-cp311-abi3.whl", "pip install '/dist/tega-0.1.0-cp311-abi3.whl[sim,view]'"),
        (None, "pip install 'tega[sim,view]'"),
    ],
)
def test_the_line_names_checkout_wheel_or_index(tmp_path: Path, url: str | None, line: str) -> None:
    assert with_origin(HINT, installed(tmp_path, url)) == f"install it with: {line}"


def test_a_record_that_is_broken_changes_nothing(tmp_path: Path) -> None:
    package = installed(tmp_path, None)
    (tmp_path / "tega-0.1.0.dist-info" / "direct_url.json").write_text("{", encoding="utf-8")
    assert with_origin(HINT, package) == HINT
    assert with_origin("plug it in", package) == "plug it in"
