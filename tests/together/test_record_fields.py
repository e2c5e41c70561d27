"""A record's fields keep the numbers that its files have, and what ``reference.record_fields --update`` takes in."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest

import tega
from reference import record_fields
from reference.installed import OWN_FEATURE, own_feature, python
from reference.record_fields import FILE, Table, fields_now, own_messages, problems
from tega.records import Record

TESTS = Path(__file__).parents[1]


@pytest.mark.skipif(not OWN_FEATURE.is_dir(), reason="not a checkout")
def test_records_of_an_installed_foreign_feature_are_left_out(tmp_path: Path) -> None:
    known = record_fields.FILE.read_text(encoding="utf-8")
    file = tmp_path / "record-fields.json"
    file.write_text(known, encoding="utf-8")
    program = (
        "import pathlib; from tega.recording.mcap_schemas import record_messages; assert 'Grip' in record_messages()\n"
        f"from reference import record_fields as r; r.FILE = pathlib.Path({str(file)!r}); r.update()\n"
        "assert r.own_messages().keys() == record_messages().keys() - {'Grip'}"
    )
    assert python("-c", program, folder=TESTS, site=own_feature(tmp_path))[0] == ""
    assert file.read_text(encoding="utf-8") == known


def test_a_tega_that_is_not_of_the_checkout_is_named_and_refused(tmp_path: Path) -> None:
    for name in ("reference/record_fields.py", "golden/record-fields.json"):
        (tmp_path / "tests" / name).parent.mkdir(parents=True)
        shutil.copy(TESTS / name, tmp_path / "tests" / name)
    file = tmp_path / "tests/golden/record-fields.json"
    file.write_text("{}")
    words, folder = ("-m", "reference.record_fields", "--update"), tmp_path / "tests"
    _, told = python(*words, folder=folder, site=folder, code=1)
    assert f"tega is read from {Path(tega.__file__).resolve().parent}" in told
    assert "make setup" in told
    assert file.read_text() == "{}"


def test_a_record_has_the_field_numbers_that_its_files_have() -> None:
    table: Table = json.loads(FILE.read_text(encoding="utf-8"))
    messages = own_messages()
    assert problems(table, messages) == []
    for name, kind in messages.items():
        assert str(getattr(kind, "version", 1)) in table[name], "python -m reference.record_fields --update"


def made(version_: int, annotations: Mapping[str, type], **defaults: float) -> Any:
    members = {"__annotations__": {"version": ClassVar[int], "t_ns": int, **annotations}, "version": version_}
    struct: Any = type(Record)
    return struct("Made", (Record,), members | defaults, frozen=True, kw_only=True)


BEFORE = made(1, {"force_n": float}, force_n=0.0)
TWO = {"force_n": float, "more": float}
AT_THE_END = made(2, TWO, force_n=0.0, more=0.0)


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (made(2, {"more": float, "force_n": float}, force_n=0.0, more=0.0), "new ones go to the end"),
        (made(2, {"force_n": int}, force_n=0), "new ones go to the end"),
        (made(1, TWO, force_n=0.0, more=0.0), "raise the version"),
        (made(2, TWO, force_n=0.0), "more has no default"),
        (AT_THE_END, ""),
        (BEFORE, ""),
    ],
)
def test_a_field_in_the_middle_or_without_a_new_version_is_refused(kind: type[Record], sentence: str) -> None:
    found = problems({"Made": {"1": fields_now(BEFORE)}}, {"Made": kind})
    assert [sentence in one for one in found] == [True] * bool(sentence)


def test_a_version_before_that_of_files_is_refused() -> None:
    (found,) = problems({"Made": {"1": fields_now(BEFORE), "2": fields_now(AT_THE_END)}}, {"Made": BEFORE})
    assert "version 1 is before" in found
