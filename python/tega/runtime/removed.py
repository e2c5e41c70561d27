"""Name settings, stages and fields that were taken out, so that an old file gets one clear sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from tega.errors import ConfigError


class Removed(NamedTuple):
    """A setting, stage or field that was taken out.

    Attributes:
        since: Version without it.
        reason: Why, as the end of a sentence.
        hint: Next step.
        unused: Value of a field that made no use of it; a file that holds this value is read as before.
    """

    since: str
    reason: str
    hint: str
    unused: Any = None

    def sentence(self, name: str) -> str:
        """Return the message for a name."""
        return f"{name} was taken out in {self.since}: {self.reason}"


REMOVED: Final[Mapping[str, Removed]] = {
    "stages.metric shear": Removed(
        "0.3", "it was not shown to tell sliding from holding", "choose live, which reads the same contact"
    ),
}
"""Settings and stages of this package that were taken out, by name."""


def refuse_removed(name: str, removed: Mapping[str, Removed] = REMOVED) -> None:
    """Refuse what was taken out; anything else passes.

    Raises:
        ConfigError: It was taken out; the message says since when and why.
    """
    if (gone := removed.get(name)) is not None:
        raise ConfigError(gone.sentence(name), gone.hint)


def without_removed(table: Mapping[str, Any], removed: Mapping[str, Removed]) -> dict[str, Any]:
    """Return a file's table without the fields that were taken out and that it made no use of.

    Args:
        table: Fields as read from TOML or JSON; tables inside it are left as they are.
        removed: Registry of fields, by name.

    Raises:
        ConfigError: A field that was taken out was in use.
    """
    for name, value in table.items():
        if name in removed and value != removed[name].unused:
            refuse_removed(name, removed)
    return {name: value for name, value in table.items() if name not in removed}
