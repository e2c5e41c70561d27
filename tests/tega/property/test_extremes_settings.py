"""Numbers that no quantity has are refused by their key; every number that one can have passes that check."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.config import check_tree
from tega.config.check import LEAST, MOST, check_magnitudes
from tega.errors import ConfigError

TINY = st.floats(5e-324, 9e-13)
HUGE = st.floats(1.1e15, 1.7e308)
KEYS = (
    "session.duration_s",
    "tactile.thumb.options.rate_hz",
    "emg.options.rate_hz",
    "safety.emg_lost_ms",
    "stages.mapping.options.weber",
)


def tree_with(key: str, value: float) -> dict[str, Any]:
    tree: dict[str, Any] = {
        "tactile": {"thumb": {"driver": "picture-stack", "options": {"file": "a.npy"}}},
        "emg": {"driver": "emg-file", "kind": "raw", "options": {"file": "a.npy"}},
    }
    *path, last = key.split(".")
    table = tree
    for name in path:
        table = table.setdefault(name, {})
    table[last] = value
    return tree


@given(st.sampled_from(KEYS), st.one_of(TINY, HUGE), st.booleans())
def test_a_number_of_no_size_is_refused_by_its_key(key: str, value: float, negative: bool) -> None:
    tree = tree_with(key, -value if negative else value)
    with tempfile.TemporaryDirectory() as folder, pytest.raises(ConfigError) as refused:
        check_tree(tree, {}, base=Path(folder))
    assert f"{key} = " in refused.value.message
    assert "is too " in refused.value.message


@given(st.one_of(st.just(0.0), st.floats(LEAST, MOST), st.floats(-MOST, -LEAST)), st.text(max_size=5))
def test_every_other_number_passes(value: float, name: str) -> None:
    check_magnitudes({"a": {"b": [1, "x", {name: value}]}, name: True}, {})
