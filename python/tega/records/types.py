"""List the record types of TEGA and of its features."""

from __future__ import annotations

from functools import cache

from tega.records import RECORDS, Record
from tega.runtime.features import targets


@cache
def record_types() -> tuple[type[Record], ...]:
    """Return every record type: TEGA's own, then those of features in the order of their names."""
    return (*RECORDS, *(kind for _, kinds in targets("records") for kind in kinds))
