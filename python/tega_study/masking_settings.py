"""Define the settings of the masking sound: the table ``[masking]``."""

from __future__ import annotations

from typing import Annotated

import msgspec


class MaskingSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The sound that masks the vest's motors in a study: pink noise, the same in every condition.

    Attributes:
        level_dbfs: Its level (RMS), decibels below the sound card's full scale; none plays nothing. Begin
            low: how loud that is depends on card and headphones.
        output: Number or part of the name of the loudspeaker; empty for the system's own.
    """

    level_dbfs: Annotated[float, msgspec.Meta(ge=-80, le=-14)] | None = None
    output: str = ""
