"""Declare the user study: plan, lead, score, report; and the hands-free recording of episodes."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="User study: plan, lead, score and report.",
    settings={"masking": "tega_study.masking_sound:MaskingSection"},
    verbs={
        "study": Verb("tega_study.cli:study", "Plan, lead, score and report a user study."),
        "scene measure": Verb(
            "tega_study.cli.scene:measure", "Measure the filmed lifts of a study's session."
        ),
        "scene confirm": Verb("tega_study.cli.scene:confirm", "Confirm or correct a measured trial."),
        "recording take": Verb(
            "tega_study.cli.take:take", "Record episodes, begun and ended by key or pedal."
        ),
        "recording relabel": Verb("tega_study.cli.take:relabel", "Change the task or outcome of episodes."),
        "recording encode": Verb("tega_study.cli.take:encode", "Encode the pictures of a recording again."),
    },
    extra="study",
)
