"""The least value of a setting that switches something off, or nearly, is accepted, and nothing below it."""

from __future__ import annotations

import pytest

from tega.config.options import driver_options, stage_options
from tega.errors import ConfigError


@pytest.mark.parametrize("name", ["contact", "release", "slip"])
def test_no_pulse_of_a_kind_is_asked_for_by_0(name: str) -> None:
    assert getattr(stage_options("mapping", "pulses", sets=[f"{name}=0"]), name) == 0
    with pytest.raises(ConfigError, match=name):
        stage_options("mapping", "pulses", sets=[f"{name}=-0.1"])


def test_a_vest_is_limited_to_one_percent_and_not_to_none() -> None:
    assert driver_options("bhaptics-player", {"limit": 1}).limit == 1  # type: ignore[attr-defined]
    with pytest.raises(ConfigError, match="limit"):
        driver_options("bhaptics-player", {"limit": 0})
