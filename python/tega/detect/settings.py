"""The detector's numbers, all of them, and why they are what they are.

They were fixed before the detector was compared with anything: weights and thresholds of the slip were fitted on
simulated people 1000 to 1019 (``python -m tega.sim.check_events --fit 1000:1020``), and are reported on others.
"""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["FEATURES", "HAND_FEATURES", "SETTINGS", "Rule", "Settings"]

FEATURES: Final = (
    "fingers",
    "mass",
    "mass_change",
    "mass_trend",
    "flow",
    "flow_trend",
    "mean_flow",
    "peak",
    "peak_change",
    "edge_change",
    "lost",
    "gained",
)
"""What a slip is seen by in the fingertips alone:

- fingers in contact; log of their summed maps (1 + sum / 10,000), its change over 0.35 s and over 1 s;
- how far a contact's middle moves (log of 1 + pixels): the furthest over 0.35 s and over 1 s, and the mean;
- the highest peak / 20, the largest fall of a peak / 10 and of the root of an area / 20;
- how lately a finger has lost contact, or gained it: exp(-age / 0.4 s).
"""

HAND_FEATURES: Final = ("closing", "stall", "rising")
"""And in hand and arm, where they are measured: change of the closure and level less closure (the object stops the
fingers: how hard they press), in levels; change of the height over 0.35 s, decimetres."""


class Rule(NamedTuple):
    """A logistic rule, and when it makes an event.

    Attributes:
        bias: Of the sum.
        weights: One for each feature.
        enter: Share from which it is an event.
        least_s: For so long, seconds.
    """

    bias: float
    weights: tuple[float, ...]
    enter: float
    least_s: float


class Settings(NamedTuple):
    """All numbers.

    Attributes:
        quick_s: Time constant of the quick means: five frames at 60 Hz, in which noise of single frames averages out.
        slow_s: Of the slow ones: a slip of 5 mm/s moves a contact by a few pixels in that time.
        trend_s: Time constants of the pair that sees slow changes.
        step_s: Between two looks at the slip; frames come at 60 Hz, or 30 Hz in a study's tables.
        touch_s: A contact has to last so long, as three frames do: single frames flicker at the threshold.
        release_s: And its end likewise; longer, since a light contact flickers more.
        settle_s: After the first contact of a grasp fingers find their place, which looks like slipping.
        rest_s: Two slips closer than this are one (the definition that raters are given).
        lift_m: Height gained in a grasp that counts as lift-off: the object then hangs in the hand.
        down_m: So close over the height of the grasp it is being put down, and slips are not counted.
        squeeze_levels: Closure gained since first contact that counts as a deformation: rigid objects stop the hand
            before 1.1; a soft one gives on, and the simulation's bag is harmed at 1.4.
        squeeze_sd: How sure that is, levels.
        eased: A deformation is over when less than this share of it is left.
        look_ahead_s: How far the detector looks ahead in a record.
        touch: The slip by fingertips alone.
        hand: The slip where closure and height are measured as well.
    """

    quick_s: float = 0.08
    slow_s: float = 0.35
    trend_s: tuple[float, float] = (0.2, 1.0)
    step_s: float = 0.025
    touch_s: float = 0.05
    release_s: float = 0.1
    settle_s: float = 0.5
    rest_s: float = 0.5
    lift_m: float = 0.005
    down_m: float = 0.015
    squeeze_levels: float = 1.4
    squeeze_sd: float = 0.05
    eased: float = 0.8
    look_ahead_s: float = 0.5
    touch: Rule = Rule(
        -0.919,
        (-0.293, -0.005, -5.72, -0.807, 0.248, -0.055, 0.16, -1.44, -0.748, 1.06, 1.176, -0.04),
        0.5,
        0.2,
    )
    hand: Rule = Rule(
        -2.03,
        (
            -0.503,
            0.45,
            0.284,
            -1.994,
            0.128,
            0.009,
            -0.25,
            -1.725,
            0.092,
            -0.075,
            0.545,
            0.064,
            -13.126,
            -0.639,
            3.821,
        ),
        0.5,
        0.15,
    )


SETTINGS: Final = Settings()
"""The ones in use."""
