"""Declare scene cameras: video of a run, poses of printed tags, outcomes of lifts."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Scene cameras: video of a run, and outcomes of lifts by printed tags.",
    settings={"scene": "tega_scene.settings:SceneTables"},
    check="tega_scene.settings:check_table",
    records="tega_scene.video:RECORDS",
    part="tega_scene.part:open_part",
    verbs={"scene": Verb("tega_scene.cli:scene", "Score lifts by cameras that see printed tags.")},
    checks="tega_scene.doctor:check_scene",
    played="tega_scene.played:PlayedScene",
    extra="lab",
)
