"""Declare the viewers that follow a run live."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Live streams to the viewers Foxglove and Rerun.",
    streams={
        "foxglove": "tega.ui.view.foxglove_stream:FoxgloveStream",
        "rerun": "tega.ui.view.rerun_stream:RerunStream",
    },
)
