"""Verbs of ``tega-teleop``, with examples and earlier names, and the public interface, are those written down."""

from __future__ import annotations

import difflib
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

pytest.importorskip("tega_figures")
pytest.importorskip("tega_campaigns")

from reference.command import call
from tega.ui.cli.main import _EARLIER, cli, main
from tega_figures.public import public_text

SNAPSHOT = Path(__file__).resolve().parents[2] / "docs" / "public.txt"


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


@pytest.mark.parametrize(
    ("earlier", "now"),
    [("inspect", "recording inspect"), ("sim-trials", "sim trials"), ("forward", "arm forward")],
)
def test_an_earlier_name_says_the_new_one(earlier: str, now: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = call(capsys, earlier, "--help")
    assert out.startswith(f"Usage: tega-teleop {now} ")
    assert err == f"note: {earlier} is now: tega-teleop {now}\n"


@pytest.mark.parametrize(
    ("words", "now", "error"),
    [
        (["replay", "none.mcap"], "tega-teleop verify none.mcap", "none.mcap"),
        (["arm", "127.0.0.1", "--no-such"], "tega-teleop arm check 127.0.0.1", "--no-such"),
    ],
)
def test_an_argument_that_belongs_to_another_verb_now_is_passed_on(
    words: list[str], now: str, error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    note, _, rest = capsys.readouterr().err.partition("\n")
    assert ended.value.code in {1, 2}
    assert note.endswith(f" is now: {now}")
    assert error in rest


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
