"""Settings files as editors, spreadsheets and Windows leave them: each error names the next step."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega.config import load_config
from tega.errors import ConfigError

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
