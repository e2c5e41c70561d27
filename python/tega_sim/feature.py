"""Declare the simulated bench: demo, trials and synthetic devices."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Simulated bench: person, hand, objects and touch.",
    verbs={
        "demo": Verb(
            "tega_sim.cli.demo:demo", "Watch a simulated person lift three objects; no hardware.", "Start"
        ),
        "sim": Verb("tega_sim.cli.sim_trials:sim", "Run many simulated trials and compare conditions."),
    },
    extra="sim",
)
