"""Exchange markers with other programs, the run's and theirs, by the Lab Streaming Layer."""

from __future__ import annotations

from tega_markers.lsl_in import LslMarkersIn
from tega_markers.lsl_out import LslMarkersOut
from tega_markers.run import RunMarkers

__all__ = ["LslMarkersIn", "LslMarkersOut", "RunMarkers"]
