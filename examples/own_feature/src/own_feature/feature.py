"""Declare the feature: everything that it adds to TEGA, by name and imported when needed."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Number of fingers in contact.",
    settings={"grip": "own_feature.settings:GripTable"},
    records="own_feature.records:RECORDS",
    part="own_feature.part:open_part",
    checks="own_feature.doctor:check_grip",
    panels="own_feature.panel:show_grip",
    in_play=True,
    verbs={"grip": Verb("own_feature.verb:grip", "Count the firm grips of a recording.", "Examine")},
    formats={"grips": "own_feature.grips_format:FORMAT"},
    streams={"grips": "own_feature.stream:GripLines"},
)
