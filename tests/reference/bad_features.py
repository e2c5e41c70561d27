"""Features of another package, installed for a test."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from reference.installed import distribution
from tega.records import types
from tega.runtime import features as loader

Install = Callable[..., None]


GOOD = """
from tega.runtime.features import Feature, Verb
FEATURE = Feature(summary="Load.", {members})
"""
MEMBERS = """
from typing import Annotated, Any, ClassVar
import click, msgspec
from tega.loop.parts import Part
from tega.records import Contact, Marker, Record
from tega.records.base import Count, Ns, quantity
from tega.setup.doctor import Finding

class Table(msgspec.Struct):
    warn_n: float = 1.0

class Load(Record, frozen=True, kw_only=True):
    topic: ClassVar[str] = "/load"
    t_ns: Ns
    fingers: Count

class Extra(Record, frozen=True, kw_only=True):
    topic: ClassVar[str] = "/load/extra"
    t_ns: Ns

RECORDS = (Load,)

class LoadPart(Part):
    pass

{code}

def open_part(context):
    part = LoadPart()
    part.bus = context.bus
    return part
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    modules: list[str] = []

    def forget() -> None:
        loader._loaded.cache_clear()
        loader._WARNINGS.clear()
        loader._SHOW.clear()
        types.record_types.cache_clear()

    def add(
        members: str = "", code: str = "", *, name: str = "load", of: str = "tega-load", head: str = ""
    ) -> None:
        package = of.replace("-", "_")
        modules.extend((package, f"{package}.members"))
        site = tmp_path / of
        distribution(site, of, f"[tega.features]\n{name} = {package}:FEATURE\n")
        (site / package).mkdir()
        (site / package / "__init__.py").write_text(head + GOOD.format(members=members))
        (site / package / "members.py").write_text(MEMBERS.format(code=code))
        monkeypatch.syspath_prepend(str(site))
        forget()

    forget()
    yield add
    for module in modules:
        sys.modules.pop(module, None)
    monkeypatch.undo()
    forget()


RECORDS = 'records="tega_load.members:RECORDS"'
