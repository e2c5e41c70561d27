"""Define the settings of markers: the table ``[markers]``."""

from __future__ import annotations

from typing import Literal

import msgspec

LslStreamName = Literal["emg", "closure", "touch", "vest", "poses"]


class MarkersSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Markers by the Lab Streaming Layer; needs the extra ``lsl``.

    Attributes:
        lsl_out: Name of the stream on which a run sends its states, faults, trials and pedals; none to send none.
        lsl_in: Name of another program's stream of markers, which are recorded; none means none are.
        lsl_streams: Which numbers of a run go out as streams: ``emg``, ``closure``, ``touch``, ``vest``, ``poses``.
            Their names begin with ``lsl_out``, or ``tega``.
    """

    lsl_out: str | None = None
    lsl_in: str | None = None
    lsl_streams: tuple[LslStreamName, ...] = ()
