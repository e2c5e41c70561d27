"""Fields of trials, objects and studies that were taken out; older files that made no use of them are still read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from tega.runtime.words import Removed, without_removed

_NEW: Final = "plan anew without it; the version that wrote the file reads it"

REMOVED_FIELDS: Final[Mapping[str, Removed]] = {
    "shear": Removed("0.3", "simulated gels no longer give way sideways", _NEW, "off"),
    "hand": Removed("0.3", "the decoder always gives the hand's level", _NEW, "decoder"),
    "beside": Removed("0.3", "answers of stages beside the connected ones are in the tables", _NEW, []),
    "relief_counts": Removed("0.3", "simulated objects have no relief", _NEW, 0.0),
    "relief_mm": Removed("0.3", "simulated objects have no relief", _NEW, 0.6),
}
"""Fields by name."""


def trial_fields(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a trial and its object, less those that were taken out and not in use.

    A field that was taken out and was in use raises :class:`ConfigError`.
    """
    fields = without_removed(table, REMOVED_FIELDS)
    if isinstance(spec := fields.get("spec"), dict):
        fields["spec"] = without_removed(spec, REMOVED_FIELDS)
    return fields
