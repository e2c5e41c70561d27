"""Names, numbers and texts of settings: plain names, sizes, TOML that is read as it was written, and its hints."""

from __future__ import annotations

import math
import tempfile
import tomllib
from datetime import datetime
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tega.config import check_tree, load_config, override_tree
from tega.config.check import LEAST, MOST, check_magnitudes
from tega.devices import Found
from tega.errors import ConfigError, UnsafeNameError
from tega.runtime.files.foreign_file import plain_name
from tega.runtime.files.toml_text import toml_value, tree_text
from tega.runtime.words import number_text
from tega.setup.doctor import lab_settings
from tega.setup.doctor.bench import DriverProbe

PIECES = st.sampled_from(
    ["..", ".", "/", "\\", "~", "C:", "\0", "\n", "%2e", "aux", "nul", "a", "b.csv", "-", " ", "é", "*"]
)


@given(name=st.text(max_size=20) | st.lists(PIECES, max_size=8).map("".join))
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


plain = (
    st.text()
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.datetimes(
        datetime(2026, 1, 1), datetime(2027, 1, 1), timezones=st.timezones(), allow_imaginary=False
    )
    # Python compares times that a clock change repeats as unequal to every time of another zone.
    .filter(lambda t: t.utcoffset() == t.replace(fold=1 - t.fold).utcoffset())
    .map(lambda t: t.replace(microsecond=0))
)
values = st.recursive(
    plain,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
trees = st.dictionaries(st.text(), values, max_size=4)


@given(values)
def test_a_value_stands_on_one_line(value: Any) -> None:
    line = f"it = {toml_value(value)}"
    assert len(line.splitlines()) == 1 or "\n" not in line
    assert tomllib.loads(line) == {"it": value}


@given(trees)
def test_nested_tables_come_back(tree: dict[str, Any]) -> None:
    assert tomllib.loads(tree_text({**tree, "left out": None})) == {
        k: v for k, v in tree.items() if k != "left out"
    }


texts = st.text(max_size=30)
option_values = st.one_of(texts, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(-1e9, 1e9))
options = st.dictionaries(st.from_regex(r"[a-z_]{1,9}", fullmatch=True), option_values, max_size=4)


def found(driver: str) -> st.SearchStrategy[Any]:
    return st.builds(
        Found, driver=st.just(driver), label=texts, options=options, problem=texts, hint=texts, note=texts
    )


@given(
    st.lists(found("digit"), max_size=6),
    st.lists(found("cyton"), max_size=2),
    st.lists(found("lsl-emg"), max_size=2),
)
def test_settings_are_toml_that_holds_the_options(digits, boards, streams) -> None:
    looked = {
        "digit": DriverProbe("tactile", digits),
        "cyton": DriverProbe("emg", boards),
        "lsl-emg": DriverProbe("emg", streams),
    }
    tree = tomllib.loads(lab_settings(looked, name="lab.toml"))
    written = [section.get("options", {}) for section in tree.get("tactile", {}).values()]
    assert len(written) == min(4, len(digits))
    assert all(any(section == one.options for one in digits) for section in written)
    assert ("emg" in tree) is bool(boards or streams)
    if boards or streams:
        assert any(tree["emg"].get("options", {}) == one.options for one in [*boards, *streams])


TINY = st.floats(5e-324, 9e-13)
HUGE = st.floats(1.1e15, 1.7e308)
KEYS = (
    "session.duration_s",
    "tactile.thumb.options.rate_hz",
    "emg.options.rate_hz",
    "safety.emg_lost_ms",
    "stages.mapping.options.first_steps",
)


@given(st.sampled_from(KEYS), st.one_of(TINY, HUGE), st.booleans())
def test_a_number_of_no_size_is_refused_by_its_key(key: str, value: float, negative: bool) -> None:
    tree: dict[str, Any] = {
        "tactile": {"thumb": {"driver": "picture-stack", "options": {"file": "a.npy"}}},
        "emg": {"driver": "emg-file", "kind": "raw", "options": {"file": "a.npy"}},
    }
    override_tree(tree, [f"{key}={-value if negative else value!r}"])
    with tempfile.TemporaryDirectory() as folder, pytest.raises(ConfigError) as refused:
        check_tree(tree, {}, base=Path(folder))
    assert f"{key} = " in refused.value.message
    assert "is too " in refused.value.message


@given(st.one_of(st.just(0.0), st.floats(LEAST, MOST), st.floats(-MOST, -LEAST)), st.text(max_size=5))
def test_every_other_number_passes(value: float, name: str) -> None:
    check_magnitudes({"a": {"b": [1, "x", {name: value}]}, name: True}, {})


_EMG = '[emg]\ndriver = "emg-file"\nkind = "raw"\noptions = { file = FILE, rate_hz = 250 }\n'


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (_EMG.replace("FILE", r'"C:\Users\me\emg.csv"'), "single quotes, or with /"),
        (_EMG.replace("FILE", r'"C:\xdata\emg.csv"'), "single quotes, or with /"),
        (_EMG.replace("FILE", r'"C:\temp\emg.csv"'), "single quotes, or with /"),
        (_EMG.replace("FILE", r'"C:\new\emg.csv"'), "single quotes, or with /"),
        (_EMG.replace("FILE", r'"data\fast\emg.csv"'), "single quotes, or with /"),
        (_EMG.replace("FILE", "\u201cemg.csv\u201d"), "straight quotes"),
        (_EMG.replace("FILE", "'a.csv'").replace("250", "250,5"), "decimal point"),
        (_EMG.replace("FILE", "'a.csv'").replace("{ ", "{\n "), "stands on one line"),
        (_EMG.replace("FILE", "'a.csv'") + "[emg]\nkind = 'raw'\n", "twice: join them"),
        ("[emg]\ndriver = emg-file\n", "put text into quotes"),
        ("[emg\n", "toml.io"),
    ],
)
def test_the_hint_fits_the_line(text: str, hint: str, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(tmp_path / "lab.toml", environ={})
    assert hint in caught.value.hint


def test_a_path_in_single_quotes_is_as_it_stands_and_utf_16_is_named(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(_EMG.replace("FILE", r"'C:\temp\emg.csv'"))
    emg = load_config(tmp_path / "lab.toml", environ={}).config.emg
    assert emg is not None
    assert str(emg.options.file).endswith(r"C:\temp\emg.csv")
    (tmp_path / "lab.toml").write_text("[emg]\n", encoding="utf-16")
    with pytest.raises(ConfigError, match="it looks like UTF-16"):
        load_config(tmp_path / "lab.toml", environ={})


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1e4, "10000"),
        (123456.7, "123457"),
        (0.000059999999999999995, "0.00006"),
        (0.1 + 0.2, "0.3"),
        (-0.0, "0"),
        (-1.5, "-1.5"),
        (0, "0"),
        (7, "7"),
        (math.inf, "inf"),
        (math.nan, "nan"),
    ],
)
def test_a_number_has_no_exponent_and_no_rounding_noise(value: float, text: str) -> None:
    assert number_text(value) == text


@given(st.floats(-1e9, 1e9, allow_subnormal=False), st.integers(2, 15))
def test_the_text_is_the_number_to_its_digits(value: float, digits: int) -> None:
    text = number_text(value, digits)
    assert float(text) == pytest.approx(value, rel=0.6 * 10 ** (1 - digits))
    if value == 0 or abs(value) >= 1e-9:
        assert "e" not in text
