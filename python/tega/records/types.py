"""List the record types of TEGA and of its features."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import Any, Final

from tega.errors import ConfigError, TegaError
from tega.records import RECORDS, Record
from tega.records.schema import parts, schema_name
from tega.runtime.features import Feature, call_feature, having, leave_out, load_target

_PLACEHOLDER: Final = re.compile(r"{(\w+)}")


@cache
def record_types() -> tuple[type[Record], ...]:
    """Return every record type: TEGA's own, then those of features in the order of their names.

    A feature with a record that cannot be recorded, or that has the name or topic of another, is left out.
    """
    found = list(RECORDS)
    for feature in having("records"):
        kinds: list[type[Record]] = []
        try:
            for kind in load_target(feature.records, feature, tuple, "tuple of Record classes"):
                call_feature(feature, f"record {kind!r}", _check, kind, feature, (*found, *kinds))
                kinds.append(kind)
        except TegaError as error:
            leave_out(feature, error)
        else:
            found += kinds
    return tuple(found)


def _check(kind: Any, feature: Feature, others: Iterable[type[Record]]) -> None:
    """Refuse a record type of a feature that no file can hold, or that is taken for another."""
    if not (isinstance(kind, type) and issubclass(kind, Record)):
        raise ConfigError(f"{feature.records} holds {kind!r}, not a Record class", "correct it")
    name = f"record {kind.__module__}.{kind.__name__}"
    for one in others:
        same = "name" if kind.__name__ == one.__name__ else "topic" if _meet(kind.topic, one.topic) else ""
        if same:
            problem = f"{name} has the {same} of {one.__module__}.{one.__name__}"
            raise ConfigError(problem, f"choose another {same}")
    if "schema" in vars(kind):
        raise ConfigError(
            f"{name} sets its schema to {kind.schema!r}", "leave it out: it is the record's name"
        )
    if not re.fullmatch(r"(/(\w|[.-]|{\w+})+)+", kind.topic, re.ASCII):
        raise ConfigError(f"{name} has the topic {kind.topic!r}", "give it one of its own, such as /grip")
    if unknown := {*_PLACEHOLDER.findall(kind.topic)} - {*kind.__struct_fields__}:
        problem = f"{name}: its topic {kind.topic} has no field {unknown.pop()!r} to stand for"
        raise ConfigError(problem, f"one of: {', '.join(kind.__struct_fields__)}")
    taken = {schema_name(part): part for one in others for part in (one, *parts(one))}
    for part in parts(kind):
        if parts(part) or taken.get(schema_name(part), part) is not part:
            problem = f"{name} is made of {part.__name__}, which is nested or whose name is taken"
            raise ConfigError(problem, "choose another name for that struct, with plain fields")


def _meet(topic: str, other: str) -> bool:
    """Return whether two topics can be one, such as ``/a/{finger}`` and ``/a/thumb``."""
    return any(
        re.fullmatch(_PLACEHOLDER.sub("[^/]+", one), _PLACEHOLDER.sub("x", two))
        for one, two in ((topic, other), (other, topic))
    )
