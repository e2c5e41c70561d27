"""Name contacts focal, broad or mixed for a display, without names that flicker."""

from __future__ import annotations

from tega.haptics import HIGH_SHARE, ContactType, contact_type
from tega.records import Contact

BAND = 0.05
"""A share is called high from 0.55 of its maximum on, and stays so down to 0.45.

Wider than EDA's largest jump between two frames of a steady press, 4 % (docs/evidence/touch-live.md).
"""


class ContactLabels:
    """Names each finger's contact by the rule of :func:`tega.haptics.contact_type`, with hysteresis.

    A new contact is named by the rule itself. A share that was high stays so until it is clearly under the border, and
    the other way round. It is for displays: the vest's columns have no borders.
    """

    def __init__(self) -> None:
        self._high: dict[str, tuple[bool, bool]] = {}

    def name(self, contact: Contact) -> ContactType:
        """Return the label of a finger's newest contact."""
        finger, shares = contact.finger, (contact.cci_norm, contact.eda_norm)
        if not contact.in_contact or contact.eda_norm == 0:
            self._high.pop(finger, None)
            return "none"
        before = self._high.get(finger)
        if before is None:
            cci, eda = (share >= HIGH_SHARE for share in shares)
        else:
            cci, eda = (
                share >= (HIGH_SHARE - BAND if was else HIGH_SHARE + BAND)
                for share, was in zip(shares, before, strict=True)
            )
        self._high[finger] = cci, eda
        return contact_type(1.0 if cci else 0.0, 1.0 if eda else HIGH_SHARE / 2)
