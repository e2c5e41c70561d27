"""Fields of trials, objects and studies that were taken out; older files that made no use of them are still read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tega.runtime.removed import Removed

_NEW: Final = "plan anew without it; the version that wrote the file reads it"

REMOVED_FIELDS: Final[Mapping[str, Removed]] = {
    "shear": Removed("0.3", "simulated gels no longer give way sideways", _NEW, "off"),
    "relief_counts": Removed("0.3", "simulated objects have no relief", _NEW, 0.0),
    "relief_mm": Removed("0.3", "simulated objects have no relief", _NEW, 0.6),
}
"""Fields by name."""
