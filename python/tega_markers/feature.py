"""Declare markers: events of a run to and from other programs by the Lab Streaming Layer."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Markers and streams by the Lab Streaming Layer.",
    settings={"markers": "tega_markers.settings:MarkersSection"},
    part="tega_markers.run:open_part",
    in_play=True,
    extra="lsl",
)
