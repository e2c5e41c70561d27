"""Names and numbers of settings: plain names, TOML of one line, sizes that no quantity has."""

from __future__ import annotations

from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tega.errors import UnsafeNameError
from tega.runtime.files.foreign_file import plain_name

PIECES = st.sampled_from(
    ["..", ".", "/", "\\", "~", "C:", "\0", "\n", "%2e", "aux", "nul", "a", "b.csv", "-", " ", "é", "*"]
)


@given(name=st.text(max_size=200) | st.lists(PIECES, max_size=8).map("".join))
@example(name="")
@example(name="a\n")
@example(name="COM1.csv")
@example(name="x" * 129)
def test_what_is_let_through_names_something_in_its_folder(name: str) -> None:
    try:
        plain_name(name, subject="attachment", source="x.mcap")
    except UnsafeNameError as error:
        sentence = error.message
    else:
        sentence = ""
    if sentence:
        assert sentence.startswith("x.mcap: attachment ")
        assert len(sentence) < 1000
        return
    assert len(name.encode()) <= 128
    for folder in (PurePosixPath("/out"), PureWindowsPath("C:/out")):
        path = folder / name
        assert (path.parent, path.name) == (folder, name)
    assert not PureWindowsPath(name).is_reserved()
    assert name.strip(". ")
    assert not set(name) & set('<>:"/\\|?*[]\0')


@given(name=st.from_regex(r"[a-z0-9_][a-z0-9_.-]{0,20}[a-z0-9]\.(csv|mcap|toml|npy|png)", fullmatch=True))
def test_ordinary_names_are_let_through(name: str) -> None:
    if not PureWindowsPath(name).is_reserved():
        assert plain_name(name, subject="attachment", source="x.mcap") == name


@pytest.mark.parametrize(
    "name", ["session.toml", "baseline-thumb.npy", "lead-in.mcap", "p01", "tactile.thumb.contact"]
)
def test_the_program_s_own_names_are_plain(name: str) -> None:
    assert plain_name(name, subject="attachment", source="x.mcap") == name
