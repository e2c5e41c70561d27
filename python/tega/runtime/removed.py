"""Refuse settings, stages and fields that were taken out, since when and why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from tega.errors import ConfigError


class Removed(NamedTuple):
    """A setting, stage or field that was taken out; a file may still hold the value ``unused`` of a field."""

    since: str
    reason: str
    hint: str
    unused: Any = None

    def refusal(self, name: str) -> ConfigError:
        """Return the error for a name."""
        return ConfigError(f"{name} was taken out in {self.since}: {self.reason}", self.hint)


def without_removed(table: Mapping[str, Any], removed: Mapping[str, Removed]) -> dict[str, Any]:
    """Return a file's table without removed fields that it made no use of; one in use is ``ConfigError``."""
    for name, value in table.items():
        if name in removed and value != removed[name].unused:
            raise removed[name].refusal(name)
    return {name: value for name, value in table.items() if name not in removed}
