"""Each bit of a hand's status is read by itself."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from tega.wire.allegro_messages import AllegroInfo


@pytest.mark.parametrize(
    ("status", "servo_on", "must_stop"),
    [
        (0, False, False),
        (0b00001, True, False),
        (0b00010, False, True),
        (0b10000, False, True),
        (0b10011, True, True),
    ],
)
def test_the_bits_of_a_status(status: int, servo_on: bool, must_stop: bool) -> None:
    given: dict[str, Any] = dict.fromkeys((field.name for field in fields(AllegroInfo)), 0)
    info = AllegroInfo(**given | {"status": status})
    assert (info.servo_on, info.must_stop) == (servo_on, must_stop)
