"""List the record types of TEGA and of its features."""

from __future__ import annotations

from functools import cache

from tega.errors import ConfigError
from tega.records import RECORDS, Record
from tega.runtime.features import targets


@cache
def record_types() -> tuple[type[Record], ...]:
    """Return every record type: TEGA's own, then those of features in the order of their names.

    Raises ``ConfigError`` if a feature's record has the name or topic of another.
    """
    found = list(RECORDS)
    for feature, kinds in targets("records"):
        for kind in kinds:
            for one in found:
                same = "name" if kind.__name__ == one.__name__ else "topic" if kind.topic == one.topic else ""
                if same:
                    taken, of = (f"{which.__module__}.{which.__name__}" for which in (kind, one))
                    problem = f"feature {feature!r}: record {taken} has the {same} of {of}"
                    raise ConfigError(problem, f"choose another {same}")
            found.append(kind)
    return tuple(found)
