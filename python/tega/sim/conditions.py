"""Choose what the worn vest does under each condition of a comparison, and whether it is felt.

``haptic`` shows the loop's frames, ``non-haptic`` nothing, ``event-gated`` pulses at contact, slip and release, which
the person is told. The others are sham arms. Their person is told what the
haptic arm's is told, and has the same chance in everything else: a benefit that they show too does not come from
what the vest tells. See :mod:`tega.sim.operator.shams`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

if TYPE_CHECKING:
    from tega.haptics import Layout
    from tega.sim.operator.shams import Sham, ShamName


Condition = Literal[
    "haptic",
    "non-haptic",
    "silent",
    "constant",
    "unrelated",
    "permuted",
    "inverted",
    "half",
    "unfelt",
    "event-gated",
]

CONDITIONS: tuple[Condition, ...] = get_args(Condition)
"""Haptic, non-haptic, the sham arms, and event-gated."""

PULSES: Condition = "event-gated"
"""The condition in which the vest tells events only."""

_SHAMS: dict[Condition, ShamName] = {
    "haptic": "informative",
    "non-haptic": "off",
    "silent": "silent",
    "constant": "constant",
    "unrelated": "unrelated",
    "permuted": "permuted",
    "inverted": "inverted",
    "half": "half",
    "unfelt": "informative",
    "event-gated": "informative",
}


def worn(condition: Condition, *, layout: Layout, seed: int) -> Sham:
    """Return the function that turns the loop's vest frames into those that are worn."""
    from tega.sim.operator import sham_vest

    return sham_vest(_SHAMS[condition], seed=seed, layout=layout)


def feels(condition: Condition) -> bool:
    """Return whether the person feels what the vest does."""
    return condition != "unfelt"
