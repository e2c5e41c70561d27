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
    """Refuse what was taken out, since when and why in the message; anything else passes."""
    if (gone := removed.get(name)) is not None:
        raise ConfigError(gone.sentence(name), gone.hint)


def without_removed(table: Mapping[str, Any], removed: Mapping[str, Removed]) -> dict[str, Any]:
    """Return a file's table without removed fields that it made no use of; one in use is ``ConfigError``.

    Tables inside it are left as they are.
    """
    for name, value in table.items():
        if name in removed and value != removed[name].unused:
            refuse_removed(name, removed)
    return {name: value for name, value in table.items() if name not in removed}
