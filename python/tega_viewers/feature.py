"""Declare the viewers that follow a run live."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Live streams to the viewers Foxglove and Rerun.",
    streams={
        "foxglove": "tega_viewers.foxglove_stream:FoxgloveStream",
        "rerun": "tega_viewers.rerun_stream:RerunStream",
    },
)
