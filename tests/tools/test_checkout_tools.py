"""What is not in the wheel is asked for by name, and the pip line for it stands in the error."""

from __future__ import annotations

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


def run_without(code: str) -> subprocess.CompletedProcess[str]:
    """Run Python where none of the packages can be imported."""
    hide = "".join(f"sys.modules[{name!r}] = None; " for name in PACKAGES)
    words = [sys.executable, "-c", f"import sys; {hide}{code}"]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("words", "folders"),
    [
        (("soak",), ("emulators", "campaigns")),
        (("bench", "sim"), ("emulators", "figures")),
        (("init", "--emulated"), ("emulators",)),
        (("hand", "measure", "--emulated"), ("emulators",)),
    ],
    ids=" ".join,
)
def test_a_verb_without_its_package_prints_the_pip_line(
    words: tuple[str, ...], folders: tuple[str, ...]
) -> None:
    done = run_without(f"from tega.ui.cli.main import main; main({list(words)!r})")
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout == ""
    assert f"error: tega-teleop {words[0]}" in done.stderr
    hint = done.stderr.splitlines()[-1]
    assert "pip install" in hint
    assert [part.rstrip("'").rpartition("/")[2] for part in hint.split() if "tools/" in part] == list(folders)


def test_the_list_of_verbs_and_the_contract_need_none_of_the_packages() -> None:
    listed = run_without("from tega.ui.cli.main import main; main(['--help'])")
    assert listed.returncode == 0
    assert "soak" in listed.stdout
    tried = run_without("from tega.setup.contract.command import main; sys.exit(main(['digit']))")
    assert (tried.returncode, tried.stdout.split()[:2]) == (2, ["not", "tried"])
    assert "./tools/emulators" in tried.stdout
    real = run_without(
        "from tega.setup.contract.command import main; sys.exit(main(['synthetic-emg', '--set', 'rate_hz=1000']))"
    )
    assert (real.returncode, real.stdout.split()[:1]) == (0, ["ok"])


def test_another_missing_module_stays_what_it_is() -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module") as caught, needs_tools("this"):
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401
    assert not isinstance(caught.value, MissingToolError)


def test_the_folders_in_the_pip_line_are_those_of_the_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
