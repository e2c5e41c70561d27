"""What TEGA writes as TOML, the standard library reads as the same values."""

from __future__ import annotations

import tomllib
from datetime import datetime
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tega.runtime.files.toml_text import toml_value, tree_text

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
