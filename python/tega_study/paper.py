"""List the numbers of the paper's Table I and text; its objects 1 to 3 are bottle, container and bag here."""

from __future__ import annotations

PAPER_OBJECTS = ("bottle", "container", "bag")

PAPER_TABLE_1 = {
    "haptic": {
        "duration_s": (
            "152.8",
            "177.4",
            "151.5",
        ),  # without a unit; sums of ten trials fit a 15 s window (A62)
        "slips": ("2.8", "0.7", "0.3"),
        "deformations": ("0.0", "0.0", "0.5"),
        "success": ("5/5", "5/5", "5/5"),
    },
    "non-haptic": {
        "duration_s": ("168.5", "171.4", "160.1"),
        "slips": ("5.9", "4.2", "0.5"),
        "deformations": ("0.0", "0.0", "1.3"),
        "success": ("4/5", "4/5", "5/5"),
    },
}

PAPER_P = {
    "duration_s:bottle": 0.014,
    "duration_s:container": 0.763,
    "duration_s:bag": 0.017,
    "slips:bottle": 0.001,  # printed as at most this, like the next
    "slips:container": 0.001,
    "slips:bag": 0.398,
    "deformations:bag": 0.030,
}
"""Uncorrected, as printed."""

PAPER_SETUP = {
    "objects": "a bottle (rigid, heavy), a box of wipes (medium), a bag of bread (light, soft)",
    "trials": "ten trials for each object and condition; success is printed as a count of five",
    "unit": "trials, each taken as a sample of its own",
    "events": "one trained observer counted visible slips and deformations",
    "time": "printed without a unit; fits the 15 s window only as sums of ten trials",
}
"""The paper's description of its set-up, by row of the report's comparison."""
