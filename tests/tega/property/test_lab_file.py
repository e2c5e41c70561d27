"""Whatever devices call themselves, the settings that are written can be read and reach them."""

from __future__ import annotations

import tomllib
from typing import Any

import hypothesis.strategies as st
from hypothesis import given

from tega.devices import Found
from tega.setup.doctor import lab_settings
from tega.setup.doctor.bench import DriverProbe

texts = st.text(max_size=30)
values = st.one_of(texts, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(-1e9, 1e9))
options = st.dictionaries(st.from_regex(r"[a-z_]{1,9}", fullmatch=True), values, max_size=4)


def found(driver: str) -> st.SearchStrategy[Any]:
    return st.builds(
        Found, driver=st.just(driver), label=texts, options=options, problem=texts, hint=texts, note=texts
    )


@given(
    st.lists(found("digit"), max_size=6),
    st.lists(found("cyton"), max_size=2),
    st.lists(found("lsl-emg"), max_size=2),
)
def test_settings_are_toml_that_holds_the_options(
    digits: list[Found], boards: list[Found], streams: list[Found]
) -> None:
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
