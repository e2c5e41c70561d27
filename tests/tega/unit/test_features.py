"""Mistakes in a feature of one's own: each is named with its feature, and with the next step."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from tega.errors import ConfigError, InvalidValueError
from tega.records import Record
from tega.records.base import Count, Ns
from tega.records.schema import fields
from tega.runtime.features import Feature, load_target

GRIP = Feature(summary="Grip.", name="grip", package="own-feature")


@pytest.mark.parametrize("target", ["tega.loop.parts:open_prat", "tega.loop.prats:open_part"])
def test_a_misspelt_target_is_a_mistake_of_the_declaration(target: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_target(target, GRIP)
    assert error.value.message == f"feature 'grip': {target} does not exist"
    assert error.value.hint == "correct own-feature, or update it"


def test_a_field_that_no_file_can_hold_is_named() -> None:
    class Lists(Record, frozen=True, kw_only=True):
        topic: ClassVar[str] = "/lists"
        t_ns: Ns
        held: list[Any]

    class Mixed(Record, frozen=True, kw_only=True):
        topic: ClassVar[str] = "/mixed"
        t_ns: Ns
        held: Count | str = 0

    for kind in (Lists, Mixed):
        with pytest.raises(InvalidValueError, match=f"record {kind.__name__}: field held has the type"):
            fields(kind)
