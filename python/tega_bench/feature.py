"""Declare the tests of devices: acceptance, and the latency of a vest's motors."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Acceptance test of a device; latency of a vest's motors by microphone.",
    verbs={
        "acceptance": Verb(
            "tega_bench.cli:acceptance",
            "Test one device for the first time, and write a report.",
            "Prepare",
        ),
        "vest onset": Verb("tega_bench.cli:onset", "Measure how long a motor takes to start."),
    },
    extra="onset",
)
