"""Declare practice for a person: closure tracking, Fitts tests and vest lessons."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Practice: follow a level, Fitts tests, lessons for the vest.",
    verbs={
        "practice": Verb(
            "tega_practice.cli:practice",
            "Practise: follow a level with the muscles, get a score.",
            "Prepare",
        ),
        "emg fitts": Verb("tega_practice.cli:emg_fitts", "Run a Fitts test with a decoder."),
        "emg skill": Verb("tega_practice.cli:emg_skill", "Compare the scores of a person."),
        "vest learn": Verb("tega_practice.cli:learn", "Learn what contacts feel like on the vest."),
    },
)
