"""Define the table ``[grip]``."""

from __future__ import annotations

from typing import Annotated

import msgspec


class GripTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of the count.

    Attributes:
        firm_from: Fingers in contact from which a grip counts as firm, 1 to 4.
    """

    firm_from: Annotated[int, msgspec.Meta(ge=1, le=4)] = 2
