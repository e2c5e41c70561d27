"""Mistakes in a feature of one's own: each is named with its feature, and with the next step."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any, ClassVar

import pytest

from tega.config import SessionConfig
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError
from tega.loop import parts
from tega.loop.parts import PartContext, open_parts
from tega.records import Record, types
from tega.records.base import Count, Ns
from tega.records.bus import Bus
from tega.records.schema import fields
from tega.runtime.features import Feature, load_target

GRIP = Feature(summary="Grip.", package="own-feature")


@pytest.mark.parametrize("target", ["tega.loop.parts:open_prat", "tega.loop.prats:open_part"])
def test_a_misspelt_target_is_a_mistake_of_the_declaration(target: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_target(target, GRIP)
    assert error.value.message == f"{target} does not exist"
    assert error.value.hint == "correct the declaration in own-feature, or update it"


def test_a_part_that_does_not_open_names_its_feature(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_context: PartContext) -> None:
        raise ValueError("boom")

    monkeypatch.setattr(parts, "targets", lambda _member: [("grip", fails)])
    monkeypatch.setattr(parts, "features", lambda: {"grip": GRIP})
    with ExitStack() as stack, pytest.raises(DeviceUnavailableError) as error:
        open_parts(PartContext(SessionConfig(), Bus(), stack, lambda: False, lambda *_: None))
    assert error.value.message == "feature 'grip': its part does not open: ValueError: boom"
    assert "own-feature" in error.value.hint


class Held(Record, frozen=True, kw_only=True):
    """Has the topic of TEGA's own events."""

    topic: ClassVar[str] = "/touch/event"
    t_ns: Ns


class Event(Record, frozen=True, kw_only=True):
    """Has the name of TEGA's own events."""

    topic: ClassVar[str] = "/held"
    t_ns: Ns


@pytest.mark.parametrize(("kind", "same"), [(Held, "topic"), (Event, "name")])
def test_a_record_that_takes_another_s_name_or_topic_is_refused(
    monkeypatch: pytest.MonkeyPatch, kind: type[Record], same: str
) -> None:
    monkeypatch.setattr(types, "targets", lambda _member: [("grip", (kind,))])
    with pytest.raises(
        ConfigError, match=f"feature 'grip': record .* has the {same} of tega.records.touch.Event"
    ):
        types.record_types.__wrapped__()


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
