"""Turn contact metrics into vest intensities (Eq 7 to 9), and fill the vest's finger columns."""

from __future__ import annotations

from tega.haptics.motor_layout import Mirror
from tega.haptics.vest import (
    CONTACT_RULES,
    FINGERS,
    HIGH_SHARE,
    LAYOUTS,
    ContactType,
    FeltMap,
    Layout,
    MotorLevels,
    contact_type,
    intensity,
    vest_frame,
    vest_intensities,
)

__all__ = [
    "CONTACT_RULES",
    "FINGERS",
    "HIGH_SHARE",
    "LAYOUTS",
    "ContactType",
    "FeltMap",
    "Layout",
    "Mirror",
    "MotorLevels",
    "contact_type",
    "intensity",
    "vest_frame",
    "vest_intensities",
]
