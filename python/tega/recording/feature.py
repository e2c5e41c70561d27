"""Declare recordings: a run's MCAP file."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Recording of a run as MCAP.", part="tega.recording.session:open_part", extra="record"
)

OUTPUT = Feature(
    summary="Output folder of a run: tables and summary.", part="tega.recording.run_tables:open_part"
)
