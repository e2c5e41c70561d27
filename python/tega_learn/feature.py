"""Declare learned decoders: fit one to a person, compare decoders on a log."""

from __future__ import annotations

from tega.runtime.features import Feature, Verb

FEATURE = Feature(
    summary="Learned decoders: fit to a person, compared on one log.",
    verbs={
        "emg fit": Verb("tega_learn.cli.emg:fit", "Fit a decoder to a person."),
        "emg compare": Verb("tega_learn.cli.emg:compare", "Compare decoders on logs of EMG."),
    },
)
