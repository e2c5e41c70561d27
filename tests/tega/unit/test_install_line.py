"""The pip line of a hint works where the program was installed from."""

from __future__ import annotations

import json
import re
import tomllib
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest

import tega
from tega.setup.doctor.bench import DriverProbe
from tega.setup.doctor.findings import Finding
from tega.ui.cli import options
from tega.ui.cli.doctor import _paragraph
from tega.ui.cli.lists import could_not_look
from tega.ui.cli.options import with_origin

PROJECT = Path(__file__).parents[3]
HINT = "install it with: pip install 'tega[sim,view]'"


def installed(folder: Path, url: str | None) -> PathDistribution:
    """Write what pip writes of an installed package."""
    place = folder / "tega-0.1.0.dist-info"
    place.mkdir(exist_ok=True)
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


def test_doctor_init_and_devices_print_that_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(options, "distribution", lambda _name: installed(tmp_path, "file:///lab/tega"))
    finding = Finding(check="packages", status="missing", finding="packages are missing", todo=(HINT,))
    assert "pip install '/lab/tega[sim,view]'" in " ".join(_paragraph(finding, 8))
    looked = {"digit": DriverProbe("tactile", could_not="cv2 is missing", hint=HINT, lacks_package=True)}
    (line,) = could_not_look(looked)
    assert "pip install '/lab/tega[sim,view]'" in line


def test_a_record_that_is_broken_changes_nothing(tmp_path: Path) -> None:
    package = installed(tmp_path, None)
    (tmp_path / "tega-0.1.0.dist-info" / "direct_url.json").write_text("{", encoding="utf-8")
    assert with_origin(HINT, package) == HINT
    assert with_origin("plug it in", package) == "plug it in"


def extras() -> dict[str, list[str]]:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found: dict[str, list[str]] = project["optional-dependencies"]
    return found


def test_every_extra_that_a_hint_names_exists() -> None:
    known = set(extras())
    named = set()
    for source in [*Path(tega.__file__).parent.rglob("*.py"), *(PROJECT / "tools").rglob("*.py")]:
        text = source.read_text(encoding="utf-8")
        for words in re.findall(r"tega\[([a-z,-]+)\]'|extra=\"([a-z-]+)\"", text):
            named |= {name for word in words for name in word.split(",") if name}
    assert len(named) > 10
    assert named <= known, "a hint names an extra that pyproject.toml does not have"


def test_the_demo_and_the_page_are_installed_without_what_draws_pictures() -> None:
    wanted, left = set(), ["sim", "view"]
    while left:
        for line in extras()[left.pop()]:
            inner = re.fullmatch(r"tega\[([a-z,-]+)\]", line)
            if inner:
                left += inner[1].split(",")
            else:
                wanted.add(re.match(r"[\w-]+", line)[0])  # type: ignore[index]  # every line begins with a name
    assert wanted == {"joblib", "mujoco-core", "python-can", "viser"}
