"""Hints for lines of TOML, and numbers as text."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.config import load_config
from tega.errors import ConfigError
from tega.runtime.words import number_text

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


def test_a_path_in_single_quotes_is_as_it_stands(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(_EMG.replace("FILE", r"'C:\temp\emg.csv'"))
    emg = load_config(tmp_path / "lab.toml", environ={}).config.emg
    assert emg is not None
    assert str(emg.options.file).endswith(r"C:\temp\emg.csv")


def test_utf_16_is_named(tmp_path: Path) -> None:
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
