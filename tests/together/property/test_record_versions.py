"""A record's fields keep the numbers that its files have: a new field goes to the end and raises the version."""

from __future__ import annotations

import json
from typing import ClassVar

import pytest

from reference.record_fields import FILE, Table, fields_now, own_messages, problems
from tega.records import (
    Record,
)

pytest.importorskip("foxglove", reason="needs the extra tega[record]")


# Field numbers.


def _table() -> Table:
    found: Table = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def test_a_record_has_the_field_numbers_that_its_files_have() -> None:
    table, messages = _table(), own_messages()
    assert problems(table, messages) == []
    for name, kind in messages.items():
        assert str(getattr(kind, "version", 1)) in table[name], (
            "run python -m reference.record_fields --update"
        )


class _Before(Record, frozen=True, kw_only=True):
    t_ns: int
    force_n: float = 0.0


class _InTheMiddle(Record, frozen=True, kw_only=True):
    version: ClassVar[int] = 2
    t_ns: int
    more: float = 0.0
    force_n: float = 0.0


class _SameVersion(Record, frozen=True, kw_only=True):
    t_ns: int
    force_n: float = 0.0
    more: float = 0.0


class _WithoutDefault(Record, frozen=True, kw_only=True):
    version: ClassVar[int] = 2
    t_ns: int
    force_n: float = 0.0
    more: float


class _OtherType(Record, frozen=True, kw_only=True):
    version: ClassVar[int] = 2
    t_ns: int
    force_n: int = 0


class _AtTheEnd(Record, frozen=True, kw_only=True):
    version: ClassVar[int] = 2
    t_ns: int
    force_n: float = 0.0
    more: float = 0.0


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (_InTheMiddle, "new ones go to the end"),
        (_OtherType, "new ones go to the end"),
        (_SameVersion, "raise the version"),
        (_WithoutDefault, "more has no default"),
        (_AtTheEnd, ""),
        (_Before, ""),
    ],
)
def test_a_field_in_the_middle_or_without_a_new_version_is_refused(kind: type[Record], sentence: str) -> None:
    found = problems({"Made": {"1": fields_now(_Before)}}, {"Made": kind})
    assert [sentence in one for one in found] == [True] * bool(sentence)


def test_a_version_before_that_of_files_is_refused() -> None:
    (found,) = problems({"Made": {"1": fields_now(_Before), "2": fields_now(_AtTheEnd)}}, {"Made": _Before})
    assert "version 1 is before" in found
