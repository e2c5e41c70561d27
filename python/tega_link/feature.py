"""Declare the link of two stations: the operator's and the robot's machine."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Link between the operator's and the robot's station.",
    settings={"net": "tega_link.settings:NetSection"},
    check="tega_link.settings:check_table",
    part="tega_link.part:open_part",
    verbs={
        "robot": Verb(
            "tega_link.cli:robot", "Run the robot's half of a session on two machines.", "Two machines"
        ),
        "operator": Verb(
            "tega_link.cli:operator", "Run the operator's half of a session on two machines.", "Two machines"
        ),
        "net": Verb("tega_link.cli:net", "Make the keys that two stations share."),
    },
    extra="net",
)
