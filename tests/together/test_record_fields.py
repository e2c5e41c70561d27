"""A record's fields keep the numbers that its files have, and what ``reference.record_fields --update`` takes in."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import ClassVar

import pytest

import tega
from reference import record_fields
from reference.record_fields import FILE, Table, fields_now, own_messages, problems
from tega.records import (
    Record,
)

TESTS = Path(__file__).parents[1]
EXAMPLE = TESTS.parent / "examples/own_feature/src/own_feature"


def run(*words: str, folder: Path, site: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), str(site), *sys.path])
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Return a folder in which a feature that is not TEGA's is installed."""
    if not EXAMPLE.is_dir():
        pytest.skip("not a checkout")
    info = tmp_path / "site/own_feature-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info.parent / "own_feature").symlink_to(EXAMPLE, target_is_directory=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-feature\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text("[tega.features]\ngrip = own_feature.feature:FEATURE\n")
    return info.parent


def test_records_of_an_installed_foreign_feature_are_left_out(site: Path, tmp_path: Path) -> None:
    known = record_fields.FILE.read_text(encoding="utf-8")
    file = tmp_path / "record-fields.json"
    file.write_text(known, encoding="utf-8")
    program = (
        "import pathlib; from tega.recording.mcap_schemas import record_messages; assert 'Grip' in record_messages()\n"
        f"from reference import record_fields as r; r.FILE = pathlib.Path({str(file)!r}); r.update()\n"
        "assert r.own_messages().keys() == record_messages().keys() - {'Grip'}"
    )
    done = run("-c", program, folder=TESTS, site=site)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert file.read_text(encoding="utf-8") == known


def test_a_tega_that_is_not_of_the_checkout_is_named_and_refused(tmp_path: Path) -> None:
    for name in ("reference/record_fields.py", "golden/record-fields.json"):
        (tmp_path / "tests" / name).parent.mkdir(parents=True)
        shutil.copy(TESTS / name, tmp_path / "tests" / name)
    file = tmp_path / "tests/golden/record-fields.json"
    file.write_text("{}")
    there = run("-m", "reference.record_fields", "--update", folder=tmp_path / "tests", site=tmp_path)
    assert there.returncode == 1
    assert f"tega is read from {Path(tega.__file__).resolve().parent}" in there.stderr
    assert "make setup" in there.stderr
    assert file.read_text() == "{}"


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
