"""What is not in the wheel is asked for by name, and the pip line for it stands in the error."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tega.errors import MissingToolError
from tega.runtime.lifecycle import needs_tools
from tega.ui.cli.options import with_origin

PROJECT = Path(__file__).resolve().parents[2]
PACKAGES = ("tega_emulators", "tega_campaigns", "tega_figures")


# Each call is of a function with words; its output, error output and exit code are printed.
_RUN = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys({packages}))
from tega.setup.contract.command import main as contract
from tega.ui.cli.main import main as tega
for name, *words in {calls}:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = globals()[name](words)
        except SystemExit as ended:
            code = ended.code
    print(json.dumps([out.getvalue(), err.getvalue(), code]))
"""
VERBS = {
    ("soak",): ("emulators", "campaigns"),
    ("bench", "sim"): ("emulators", "figures"),
    ("init", "--emulated"): ("emulators",),
    ("hand", "measure", "--emulated"): ("emulators",),
}


def test_what_needs_a_package_prints_the_pip_line_and_the_rest_works_without() -> None:
    calls = [
        *(("tega", *words) for words in VERBS),
        ("tega", "--help"),
        ("contract", "digit"),
        ("contract", "synthetic-emg", "--set", "rate_hz=1000"),
    ]
    words = [sys.executable, "-c", _RUN.format(packages=PACKAGES, calls=calls)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    *refused, listed, tried, real = map(json.loads, done.stdout.splitlines())
    for (verb, folders), (out, err, code) in zip(VERBS.items(), refused, strict=True):
        assert (out, code) == ("", 2)
        assert f"error: tega-teleop {verb[0]}" in err
        hint = err.splitlines()[-1]
        assert "pip install" in hint
        assert tuple(p.rstrip("'").rpartition("/")[2] for p in hint.split() if "tools/" in p) == folders
    assert "soak" in listed[0]
    assert listed[2] == 0
    assert (tried[2], tried[0].split()[:2]) == (2, ["not", "tried"])
    assert "./tools/emulators" in tried[0]
    assert (real[2], real[0].split()[:1]) == (0, ["ok"])


def test_another_missing_module_stays_what_it_is() -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module") as caught, needs_tools("this"):
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401
    assert not isinstance(caught.value, MissingToolError)


def test_the_pip_line_has_the_checkout_s_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in PACKAGES:
        folder = PROJECT / "tools" / name.removeprefix("tega_")
        project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        assert project["name"] == name.replace("_", "-")
        assert (folder / name / "__init__.py").is_file()
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(MissingToolError) as caught, needs_tools("this"):
            __import__(name)
        assert f"'./tools/{folder.name}'" in caught.value.hint

    class Installed:
        def read_text(self, _name: str) -> str:
            return f'{{"url": "{tmp_path.as_uri()}"}}'

    hint = "pip install './tools/emulators'"
    assert with_origin(hint, Installed()) == hint  # type: ignore[arg-type]
    (tmp_path / "tools").mkdir()
    assert with_origin(hint, Installed()) == f"pip install '{tmp_path}/tools/emulators'"  # type: ignore[arg-type]
