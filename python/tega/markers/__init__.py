"""Markers of a run for other programs, and theirs for the run, by the Lab Streaming Layer."""

from __future__ import annotations

from tega.markers.lsl_in import LslMarkersIn
from tega.markers.lsl_out import LslMarkersOut
from tega.markers.run import RunMarkers

__all__ = ["LslMarkersIn", "LslMarkersOut", "RunMarkers"]
