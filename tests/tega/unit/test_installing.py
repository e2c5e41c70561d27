"""Installing from a checkout, programs isolated from their folder, and what is missing or was taken out named."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import PathDistribution
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import pytest
from msgspec import defstruct
from typing_extensions import TypeAliasType, TypeVar

import tega
from reference.installed import program
from tega.config import load_config
from tega.config.errors import CONSTANTS, REMOVED
from tega.errors import ConfigError, InvalidValueError, MissingExtraError
from tega.recording.origin import absent_features
from tega.records import Record
from tega.records.base import Count, Ns, quantity
from tega.records.schema import fields
from tega.runtime.child_process import own_group, python_command
from tega.runtime.features import Feature, features, load_target
from tega.runtime.removed import Removed, without_removed
from tega.setup.doctor.bench import DriverProbe
from tega.setup.doctor.findings import Finding
from tega.stages.registry import stage_class
from tega.ui.cli import options
from tega.ui.cli.doctor import _paragraph
from tega.ui.cli.lists import could_not_look
from tega.ui.cli.options import with_origin

PROJECT = Path(__file__).resolve().parents[3]


def toml(*parts: str) -> dict[str, Any]:
    return tomllib.loads(PROJECT.joinpath(*parts).read_text(encoding="utf-8"))


def test_without_rust_pip_is_told_so_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    system = toml("pyproject.toml")["build-system"]
    code = f"import sys; sys.path[:0] = {system['backend-path']!r}; import {system['build-backend']}"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("cargo") is None
    done = program(sys.executable, "-c", code, folder=PROJECT, code=1)
    (sentence,) = done.stderr.splitlines()
    assert "no program `cargo` on the PATH" in sentence
    oldest = toml("Cargo.toml")["workspace"]["package"]["rust-version"]
    assert f"Rust {oldest} or later" in sentence


def test_a_guard_is_out_of_reach_of_the_terminal() -> None:
    assert own_group("linux") == own_group("darwin") == {"start_new_session": True}
    assert own_group("win32") == {"creationflags": 0x200}  # CREATE_NEW_PROCESS_GROUP
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, **own_group()) as guard:
        if sys.platform != "win32":
            assert os.getpgid(guard.pid) == guard.pid
        guard.kill()


def test_the_version_is_one() -> None:
    version = toml("Cargo.toml")["workspace"]["package"]["version"]
    assert tega.__version__ == version
    for tool in ("emulators", "campaigns", "figures"):
        assert toml("tools", tool, "pyproject.toml")["project"]["version"] == version
    for name, line in (("CITATION.cff", r"^version: (.+)$"), ("CHANGELOG.md", r"^## ([0-9.]+)")):
        newest = re.search(line, (PROJECT / name).read_text(encoding="utf-8"), re.MULTILINE)
        assert newest is not None
        assert newest[1] == version, name
    for lock in ("Cargo.lock", "benches/Cargo.lock", "fuzz/Cargo.lock"):
        crates = [one for one in toml(*lock.split("/"))["package"] if "source" not in one]
        ours = {one["version"] for one in crates if one["name"] not in {"tega-benches", "tega-fuzz"}}
        assert ours == {version}, lock


HINT = "install it with: pip install 'tega[sim,view]'"


def installed(folder: Path, url: str | None) -> PathDistribution:
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
    package = installed(tmp_path, url)
    assert with_origin(HINT, package) == f"install it with: {line}"
    assert with_origin("plug it in", package) == "plug it in"
    (tmp_path / "tega-0.1.0.dist-info" / "direct_url.json").write_text("{", encoding="utf-8")
    assert with_origin(HINT, package) == HINT, "a record that is broken changes nothing"


def test_doctor_init_and_devices_print_that_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(options, "distribution", lambda _name: installed(tmp_path, "file:///lab/tega"))
    finding = Finding(check="packages", status="missing", finding="packages are missing", todo=(HINT,))
    assert "pip install '/lab/tega[sim,view]'" in " ".join(_paragraph(finding, 8))
    looked = {"digit": DriverProbe("tactile", could_not="cv2 is missing", hint=HINT, lacks_package=True)}
    (line,) = could_not_look(looked)
    assert "pip install '/lab/tega[sim,view]'" in line


def extras() -> dict[str, list[str]]:
    return toml("pyproject.toml")["project"]["optional-dependencies"]  # type: ignore[no-any-return]


def test_every_extra_that_a_hint_names_exists() -> None:
    known = set(extras())
    named = set()
    for source in [*Path(tega.__file__).parent.rglob("*.py"), *(PROJECT / "tools").rglob("*.py")]:
        for words in re.findall(r"tega\[([a-z,-]+)\]'|extra=\"([a-z-]+)\"", source.read_text("utf-8")):
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


ROOTS = [PROJECT / name for name in ("python", "tools/campaigns", "tools/emulators")]
_SYSTEM = r"(os|pty)\.(exec|spawn|posix_spawn|system|popen|fork)"
STARTS = re.compile(
    r"(subprocess\.)?Popen|subprocess\.(run|call|check_call|check_output)|(.*\.)?create_subprocess_(exec|shell)"
    rf"|{_SYSTEM}\w*"
)
WORKERS = {"joblib", "multiprocessing", "ProcessPoolExecutor", "loky"}
# A file without any of these starts nothing, and is not parsed.
HINTS = re.compile(
    rf"Popen|subprocess|executable|from sys|[\"']python|\b{_SYSTEM}|{'|'.join(sorted(WORKERS))}"
)
OTHER_PROGRAMS = {
    "python/tega/devices/machine.py": "ip",
    "tools/campaigns/tega_campaigns/mutants/drawn.py": "cargo",
    "tools/emulators/tega_emulators/message_bus.py": "dbus-daemon",
    "tools/emulators/tega_emulators/openxr_runtime.py": "cargo",
}
"""What starts a program that is not Python."""


def dotted(node: ast.expr) -> str:
    """Return a name with dots, such as ``subprocess.run``; ``""`` for anything else but what ends with one."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def started(path: Path) -> list[str]:
    """Return what a file of Python starts otherwise than by `python_command`, `python_environment` and the like."""
    text = path.read_text(encoding="utf-8")
    if not HINTS.search(text):
        return []
    tree = ast.parse(text)
    calls = {
        node: name for node in ast.walk(tree) if isinstance(node, ast.Call) if (name := dotted(node.func))
    }
    called = {name.rpartition(".")[2] for name in calls.values()}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and dotted(node) == "sys.executable":
            found.append(f"{node.lineno}: names sys.executable")
        if isinstance(node, ast.ImportFrom) and node.module == "sys":
            found.append(f"{node.lineno}: imports from sys")
        if isinstance(node, ast.List | ast.Tuple) and node.elts:
            first = node.elts[0]
            named = first.value if isinstance(first, ast.Constant) else None
            if isinstance(named, str) and re.fullmatch(r"python[0-9.]*", named):
                found.append(f"{node.lineno}: names {named}")
    found += [
        f"{call.lineno}: starts without python_environment"
        for call, name in calls.items()
        if STARTS.fullmatch(name) and "python_environment" not in called
    ]
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    words = {word for node in imports for word in re.findall(r"\w+", ast.unparse(node))}
    if words & WORKERS and "isolated_workers" not in called:
        found.append("1: starts workers without isolated_workers")
    return found


@pytest.mark.skipif(not ROOTS[-1].is_dir(), reason="not a checkout")
def test_whoever_starts_python_goes_through_one_function() -> None:
    found = {
        path.relative_to(PROJECT).as_posix(): places
        for root in ROOTS
        for path in sorted(root.rglob("*.py"))
        if path.name != "child_process.py" and (places := started(path))
    }
    assert {path: places for path, places in found.items() if path not in OTHER_PROGRAMS} == {}
    assert set(OTHER_PROGRAMS) <= set(found), "starts no program any more"
    for path in OTHER_PROGRAMS:
        assert all("without python_environment" in place for place in found[path]), found[path]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import sys, subprocess\nsubprocess.run([sys.executable, '-m', 'tega.ui.cli'])", "sys.executable"),
        ("from sys import executable", "imports from sys"),
        ("subprocess.Popen(['python3', 'a.py'], env=python_environment())", "names python3"),
        ("subprocess.Popen(python_command('tega.ui.cli'))", "without python_environment"),
        ("await asyncio.create_subprocess_exec(*words)", "without python_environment"),
        ("os.execv(words[0], words)", "without python_environment"),
        ("from concurrent.futures import ProcessPoolExecutor", "without isolated_workers"),
        ("import multiprocessing.pool", "without isolated_workers"),
    ],
)
def test_what_goes_past_it_is_found(source: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(source)
    assert any(message in place for place in started(tmp_path / "a.py"))


def test_a_program_finds_the_package_s_folder_and_nothing_inside_it() -> None:
    package = Path(tega.__file__).resolve().parent
    # The module `site` prints the import path.
    message = subprocess.run(python_command("site"), capture_output=True, text=True, check=True).stdout
    assert repr(str(package.parent)) in message
    assert repr(str(package)) not in message


GONE = {"shear": Removed("0.3", "nothing gives way", "plan anew", "off")}


def test_a_stage_that_was_taken_out_is_refused_by_one_sentence() -> None:
    sentence = r"^stages\.metric shear was taken out in 0\.3: it was not shown"
    with pytest.raises(ConfigError, match=sentence) as refused:
        stage_class("metric", "shear")
    assert "live" in refused.value.hint
    with pytest.raises(ConfigError, match=r"stages\.metric shear was taken out in 0\.3"):
        load_config(None, environ={}, sets=["session.preset=live", "stages.metric.name=shear"])


def test_fields_that_were_taken_out_pass_where_they_were_unused_and_are_refused_where_they_were_not() -> None:
    assert without_removed({"shear": "off", "view": "direct"}, GONE) == {"view": "direct"}
    with pytest.raises(ConfigError, match=r"^shear was taken out in 0\.3: nothing gives way"):
        without_removed({"shear": "dots", "view": "direct"}, GONE)


@pytest.mark.parametrize("name", REMOVED)
def test_a_removed_setting_names_its_version_and_what_to_set(tmp_path: Path, name: str) -> None:
    key, _, value = name.partition(" = ")
    table, _, leaf = key.rpartition(".")
    file = tmp_path / "lab.toml"
    file.write_text(f'[{table}]\n{leaf} = "{value or "odd"}"\n', encoding="utf-8")
    gone = REMOVED[name]
    with pytest.raises(ConfigError) as refused:
        load_config(file, environ={})
    assert refused.value.message == f"lab.toml:2: {name} was taken out in {gone.since}: {gone.reason}"
    assert refused.value.hint == gone.hint
    with pytest.raises(ConfigError, match=r"--set: .* was taken out"):
        load_config(None, environ={}, sets=[f"{key}={value or 'odd'}"])


BESIDE = {
    "arm": "arm.driver=simulated-arm",
    "calibration": "session.preset=live",
    "hand": "hand.driver=python-can",
    "stages.mapping": "stages.mapping.name=changes",
    "stages.reflex": "stages.reflex.name=grip",
    "vest": "vest.driver=bhaptics-player",
}


@pytest.mark.parametrize("key", CONSTANTS)
def test_a_setting_that_became_a_constant_is_read_with_its_value_only(key: str) -> None:
    beside = next(sets for table, sets in BESIDE.items() if key.startswith(table))
    plain = load_config(None, environ={}, sets=[beside]).config
    assert load_config(None, environ={}, sets=[beside, f"{key}={CONSTANTS[key]!r}"]).config == plain
    with pytest.raises(ConfigError, match=r"--set: .* was taken out in 0\.3; leave it out: it is always"):
        load_config(None, environ={}, sets=[beside, f"{key}=0.07"])


def test_a_feature_that_is_not_installed_is_named_and_only_tega_s_own_package_recommended() -> None:
    here = next(iter(features()))
    (text,) = absent_features({"features": {"grip": "tega[lab]", here: "tega"}})
    assert "'grip'" in text
    assert text.endswith("pip install 'tega[lab]'")
    assert absent_features({}) == []
    (text,) = absent_features({"features": {"grip": "own-feature[lab]"}})
    assert "pip install" not in text
    assert "'own-feature[lab]'; ask who made it" in text


@pytest.mark.parametrize(
    ("name", "requirement"),
    [
        ("grip", "x' && rm -rf '"),
        ("grip", "--index-url=http://example.org x"),
        ("grip", "own feature"),
        ("grip", "x\n"),
        ("\x1b[2Jgrip", "own-feature"),
        ("g" * 1000, "own-feature"),
    ],
)
def test_nothing_but_names_is_printed_out_of_a_recording(name: str, requirement: str) -> None:
    assert absent_features({"features": {name: requirement}}) == []


def test_a_feature_of_another_package_is_installed_by_that_package_s_name() -> None:
    feature = Feature(summary="Grip.", extra="lab", package="own-feature")
    with pytest.raises(MissingExtraError) as error:
        load_target("no_such_module:x", feature)
    assert error.value.hint == "install it with: pip install 'own-feature[lab]'"


@pytest.mark.parametrize("target", ["tega.loop.parts:open_prat", "tega.loop.prats:open_part"])
def test_a_misspelt_target_is_a_mistake_of_the_declaration(target: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_target(target, Feature(summary="Grip.", name="grip", package="own-feature"))
    assert error.value.message == f"feature 'grip': {target} does not exist"
    assert error.value.hint == "correct own-feature, or update it"


Scalar = TypeVar("Scalar", bound=np.generic)


def held_field(kind: Any) -> Any:
    own: dict[str, Any] = {"bases": (Record,), "namespace": {"topic": "/held"}, "frozen": True}
    return fields(defstruct("Held", [("t_ns", Ns), ("held", kind)], **own, kw_only=True))[-1]


def test_a_field_is_of_a_type_that_a_file_holds() -> None:
    for kind in (list[Any], Count | str):
        with pytest.raises(InvalidValueError, match="record Held: field held has the type"):
            held_field(kind)
    made, array, dtype = cast("Any", (TypeAliasType, np.ndarray, np.dtype))
    alias = made("Alias", array[Any, dtype[Scalar]], type_params=(Scalar,))  # as NumPy 2.5 has NDArray
    assert held_field(Annotated[alias[np.float64], quantity("1", "double*")]).array
