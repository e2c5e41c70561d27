"""Settings of an earlier version are refused with one sentence; what is in use today is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tega.config import load_config
from tega.config.removed import CONSTANTS, REMOVED
from tega.errors import ConfigError


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


def test_a_value_beside_a_removed_one_is_read() -> None:
    loaded = load_config(None, environ={}, sets=["arm.driver=simulated-arm"])
    assert loaded.config.arm is not None


BESIDE = {
    "arm": "arm.driver=simulated-arm",
    "hand": "hand.driver=python-can",
    "stages": "stages.mapping.name=changes",
}


@pytest.mark.parametrize("key", CONSTANTS)
def test_a_setting_that_became_a_constant_is_read_with_its_value_only(key: str) -> None:
    beside = BESIDE[key.partition(".")[0]]
    plain = load_config(None, environ={}, sets=[beside]).config
    assert load_config(None, environ={}, sets=[beside, f"{key}={CONSTANTS[key]!r}"]).config == plain
    with pytest.raises(ConfigError, match=r"--set: .* was taken out in 0\.3; leave it out: it is always"):
        load_config(None, environ={}, sets=[beside, f"{key}=0.07"])
