"""Exchange markers with other programs, the run's and theirs, by the Lab Streaming Layer."""

from __future__ import annotations

from tega.lsl_events.lsl_in import LslMarkersIn
from tega.lsl_events.lsl_out import LslMarkersOut
from tega.lsl_events.run import RunMarkers

__all__ = ["LslMarkersIn", "LslMarkersOut", "RunMarkers"]
