"""Verbs of ``tega-teleop``, examples, earlier names, the public interface, and what is not in the wheel."""

from __future__ import annotations

import difflib
import json
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

pytest.importorskip("tega_figures")
pytest.importorskip("tega_campaigns")

from reference.command import call
from tega.errors import MissingToolError
from tega.runtime.lifecycle import needs_tools
from tega.ui.cli.main import _EARLIER, cli, main
from tega.ui.cli.options import with_origin
from tega_figures.public import public_text

PROJECT = Path(__file__).resolve().parents[2]
SNAPSHOT = PROJECT / "docs" / "public.txt"


def verbs(command: click.Command = cli, path: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    yield " ".join(path), command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from verbs(inner, (*path, name))


VERBS = dict(verbs())


def test_every_earlier_name_stands_for_a_verb() -> None:
    assert set(_EARLIER.values()) <= set(VERBS)


@pytest.mark.words
@pytest.mark.parametrize("name", VERBS)
def test_the_example_of_a_verb_is_one_of_its_own_calls(name: str) -> None:
    text = VERBS[name].epilog or ""
    assert text.startswith("Example: tega-teleop ")
    assert VERBS[name].get_help(click.Context(VERBS[name], terminal_width=40)).endswith(f"\n  {text}")
    words = shlex.split(text.removeprefix("Example: tega-teleop ").partition(", or ")[0].partition("; ")[0])
    command: click.Command = cli
    called: list[str] = []
    while (
        isinstance(command, click.Group)
        and words
        and words[0] in command.list_commands(click.Context(command))
    ):
        called.append(words.pop(0))
        command = VERBS[" ".join(called)]
    assert [*called, ""][: len(name.split())] == name.split()
    if isinstance(command, click.Group):
        assert command.invoke_without_command, "the example calls a verb, not a group"
    # The parser refuses options that are not there and values that are missing; values are not looked at.
    _, rest, _ = command.make_parser(click.Context(command)).parse_args(words)
    assert rest == []


@pytest.mark.parametrize("text", ["nan", "inf"])
def test_no_option_takes_a_number_of_no_size(text: str) -> None:
    for option in (option for verb in VERBS.values() for option in verb.params):
        if isinstance(option.type, click.types.FloatParamType):
            with pytest.raises(click.BadParameter):
                option.type(text)


@pytest.mark.parametrize(("earlier", "now"), [("inspect", "recording inspect"), ("sim-trials", "sim trials")])
def test_an_earlier_name_says_the_new_one(earlier: str, now: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = call(capsys, earlier, "--help")
    assert out.startswith(f"Usage: tega-teleop {now} ")
    assert err == f"note: {earlier} is now: tega-teleop {now}\n"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["replay", "none.mcap"], "error: replay none.mcap is now: tega-teleop verify none.mcap"),
        (["arm", "check", "127.0.0.1"], "error: arm was taken out: doctor SETTINGS.toml checks a robot"),
    ],
)
def test_what_is_another_verb_s_now_names_it(
    words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code in {1, 2}
    assert capsys.readouterr().err.startswith(text)


def test_debug_is_one_option_of_all_verbs() -> None:
    assert [name for name, verb in VERBS.items() if any("--debug" in p.opts for p in verb.params)] == [""]


@pytest.mark.words
@pytest.mark.skipif(not SNAPSHOT.is_file(), reason="not a checkout")
def test_the_public_interface_is_the_one_that_is_written_down() -> None:
    before, now = SNAPSHOT.read_text(encoding="utf-8"), public_text()
    changed = "\n".join(
        difflib.unified_diff(before.splitlines(), now.splitlines(), "written", "now", n=0, lineterm="")
    )
    assert not changed, (
        f"{changed}\nif that is meant: python tools/figures/tega_figures/public.py docs/public.txt, and a line of "
        "migration in changes/"
    )


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
NEEDING = {
    ("soak",): ("emulators", "campaigns"),
    ("bench", "sim"): ("emulators", "figures"),
    ("init", "--emulated"): ("emulators",),
    ("hand", "measure", "--emulated"): ("emulators",),
}


def test_what_needs_a_package_prints_the_pip_line_and_the_rest_works_without() -> None:
    calls = [
        *(("tega", *words) for words in NEEDING),
        ("tega", "--help"),
        ("contract", "digit"),
        ("contract", "synthetic-emg", "--set", "rate_hz=1000"),
    ]
    words = [sys.executable, "-c", _RUN.format(packages=PACKAGES, calls=calls)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    *refused, listed, tried, real = map(json.loads, done.stdout.splitlines())
    for (verb, folders), (out, err, code) in zip(NEEDING.items(), refused, strict=True):
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
