"""Define the record of the count."""

from __future__ import annotations

from typing import ClassVar

from tega.records import Record
from tega.records.base import Count, Ns


class Grip(Record, frozen=True, kw_only=True):
    """Number of fingers in contact, whenever it changes.

    Attributes:
        t_ns: Time of the picture that changed it, since the start of the session.
        fingers: Fingers in contact.
        firm: Whether that is a firm grip.
    """

    topic: ClassVar[str] = "/grip"

    t_ns: Ns
    fingers: Count
    firm: bool


RECORDS = (Grip,)
"""Record types of this feature."""
