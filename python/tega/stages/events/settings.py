"""Define all the detector's numbers, with the reason for each.

The numbers were fixed before any comparison. The slip's rules were fitted on simulated people 1000 to 1022
(``tega_figures.check_events --fit 1000:1023`` of commit 2b4cc804), the one by joints on 5000 to 5074 as well, and are
reported on others.
"""

from __future__ import annotations

from typing import Final, NamedTuple

FEATURES: Final = (
    "fingers", "mass", "mass_change", "mass_trend", "flow", "flow_trend", "mean_flow", "peak",
    "peak_change", "edge_change", "lost", "gained",
)  # fmt: skip
"""Features of a slip in the fingertips alone:

- fingers in contact; log of their summed maps (1 + sum / 10,000), its change over 0.35 s and over 1 s;
- how far a contact's middle moves (log of 1 + pixels): the furthest over 0.35 s and over 1 s, and the mean;
- the highest peak / 20, the largest fall of a peak / 10 and of the root of an area / 20;
- how lately a finger has lost contact, or gained it: exp(-age / 0.4 s).
"""

_HELD: Final = ("eased", "weakest", "closing", "stall", "rising", "opened", "widest", "fresh")
HAND_FEATURES: Final = (*FEATURES, *_HELD)
"""Features of a slip if hand and arm are measured, which gives lift-off: those of :data:`FEATURES` and the ones
below. A hanging object slides when the grip becomes weaker than at any time since lift-off:

- how far the log of the fingertips' summed maps is below that at lift-off, and below its lowest since, 0.4 s ago or
  longer;
- change of the closure over 0.35 s, and level less closure (the object stops the fingers: how hard they press), levels;
- change of the height over 0.35 s, decimetres;
- how far the closure is below that at lift-off, and below its lowest since, 0.4 s ago or longer, levels;
- exp(-time since lift-off / 1 s).
"""

SINK_FEATURES: Final = (*_HELD, "over_20_ms", "over_40_ms", "over_80_ms", "over_200_ms", "fastest", "slowest")
"""Features of a slip if the hand's joints also give the fingertips' places. Fingers that give way let the object
down. The features are the last eight of :data:`HAND_FEATURES`, for how the object is held; and the speed at which the
fingertips in contact sink against the palm, millimetres a second,

- in the mean by their summed maps, over 20, 40, 80 and 200 ms;
- the one that sinks fastest, and the one that sinks least, over 40 ms.
"""


class Rule(NamedTuple):
    """A logistic rule: an event where its share reaches ``enter`` for ``least_s``.

    ``weights`` has one for each feature, ``products`` two features' places and their product's weight.
    """

    bias: float
    weights: tuple[float, ...]
    enter: float
    least_s: float
    products: tuple[tuple[int, int, float], ...] = ()


class DetectorSettings(NamedTuple):
    """All numbers of the detector.

    Attributes:
        quick_s: Time constant of the quick means: five frames at 60 Hz, in which noise of single frames averages out.
        slow_s: Time constant of the slow means: a slip of 5 mm/s moves a contact by a few pixels in that time.
        trend_s: Time constants of the pair that sees slow changes.
        step_s: Between two looks at the slip; frames come at 60 Hz, or 30 Hz in a study's tables.
        touch_s: A contact has to last so long, as three frames do: single frames flicker at the threshold.
        release_s: The end of a contact has to last so long; longer, since a light contact flickers more.
        settle_s: After the first contact of a grasp fingers find their place, which looks like slipping.
        before_s: Age from which a value counts as before: a slip's first half second counts as its beginning, and 0.4
            s leave it room.
        fade_s: Time constant with which a lost or gained contact is forgotten.
        stale_s: Gap after which a fingertip is reset, so that the gap itself is no event.
        noise_sum: Sum of a map that is no more than noise; below it nothing is said of how firm a grip is.
        pressed_levels: A closure so far behind its level presses on something, whatever the fingertips see.
        rest_s: Two slips closer than this are one (the definition that raters are given).
        lift_m: Height gained in a grasp that counts as lift-off: the object then hangs in the hand.
        down_m: So close over the height of the grasp it is being put down, and slips are not counted.
        lowered_m: Recent fall of the height (quick mean less slow one) that counts as putting the object down.
        sink_s: Times over which fingertips sink, seconds; the joints are known to 0.3 mm/s over 33 ms.
        look_ahead_s: Time that the detector looks ahead in a record.
        touch: The slip by fingertips alone.
        hand: The slip where closure and height are measured as well. Both look at products of two features, too.
        sink: The slip where the fingertips' places are, besides.
    """

    quick_s: float = 0.08
    slow_s: float = 0.35
    trend_s: tuple[float, float] = (0.2, 1.0)
    step_s: float = 0.025
    touch_s: float = 0.05
    release_s: float = 0.1
    settle_s: float = 0.5
    before_s: float = 0.4
    fade_s: float = 0.4
    stale_s: float = 0.1
    noise_sum: float = 3000.0
    pressed_levels: float = 0.2
    rest_s: float = 0.5
    lift_m: float = 0.005
    down_m: float = 0.015
    lowered_m: float = 0.003
    sink_s: tuple[float, ...] = (0.02, 0.04, 0.08, 0.2)
    look_ahead_s: float = 0.5
    touch: Rule = Rule(
        -5.8946,
        # In the order of FEATURES.
        (
            2.1205, -1.494, 52.5498, -6.1988, -0.6351, 2.4553, 1.9707, -0.8868, 6.2167, -0.6419, 0.7546,
            -19.0553,
        ),
        0.5, 0.15,
        (
            (5, 5, -0.4741), (1, 8, -1.6591), (0, 2, -7.8317), (2, 5, -4.2975), (6, 6, -0.5209),
            (3, 10, -7.9195), (0, 11, 4.4433), (10, 11, 6.3563), (1, 4, 0.3253), (2, 7, -9.9082),
            (1, 3, 2.0532), (0, 0, -0.2841),
        ),
    )  # fmt: skip
    hand: Rule = Rule(
        30.2489,
        # In the order of HAND_FEATURES.
        (
            -10.2649, -9.8388, 42.4042, -1.2674, 0.5033, 0.0263, 0.1908, -0.1756, -0.4771, 6.7329,
            -4.6272, 6.601, 1.0313, -0.3612, -9.0024, -0.8237, 3.042, 0.2651, 14.4225, 1.2045,
        ),
        0.5, 0.05,
        (
            (0, 1, 2.6646), (11, 13, -30.0235), (9, 10, -20.9159), (11, 14, -32.1477), (18, 19, -27.344),
            (2, 19, -11.2763), (16, 16, -7.0636), (8, 12, 4.8413), (11, 15, -3.3792), (0, 2, -10.9447),
            (1, 9, -1.798), (6, 19, 2.4992),
        ),
    )  # fmt: skip
    sink: Rule = Rule(
        -9.0967,
        # In the order of SINK_FEATURES.
        (
            2.0397, -1.4701, -6.7659, -1.7636, 1.2527, -1.8966, 2.5943, -0.097, 0.916, 0.6497, -0.559,
            -0.4519, 0.4686, -0.2729,
        ),
        0.5, 0.01,
    )  # fmt: skip


SETTINGS: Final = DetectorSettings()
"""The ones in use."""
