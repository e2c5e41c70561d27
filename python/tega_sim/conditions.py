"""Choose the content of the worn vest under each condition of a comparison, with its motors and skin.

``haptic`` shows the loop's frames, ``non-haptic`` nothing, ``event-gated`` pulses at contact, slip and release. The
person knows of the pulses.

The shams carry no information or wrong information. Their person has the same instructions as in the haptic arm, and
the same random numbers in everything else: a benefit that a sham shows too does not come from the vest's information.
See :mod:`tega_sim.operator.shams`.

The positive controls show the truth, which no sensor has to measure: a person who gains nothing from them could not
have gained from a vest. ``oracle`` pulses at true slips, ``true-force`` shows the pads' true forces by the law of the
real vest, ``true-steps`` in equal steps of sensation (:mod:`tega.stages.equal_steps`), ``ideal-vest`` in proportion,
on a skin that misses nothing. From one to the next, ``ideal-vest``, ``true-force`` or ``true-steps``, and ``haptic``
with the same mapping add the real vest with its wearer's skin, and the real measurement from camera frames. The sham
of ``oracle`` is ``mistimed``: the pulses of another trial.

``reflex`` has no vest and a reflex that firms the grip (:mod:`tega.loop.reflex`), ``haptic-reflex`` both, with the
settings' reflex or, if they name none, ``grip``. The reflex has the authority of the settings or, if that is 0, full
authority: a reflex of the settings without authority acts in these arms alone. ``true-reflex`` is their positive
control: the same reflex receives the true speed of the slide.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple, TypeAlias, get_args

from tega_sim.operator.shams import ShamName

Condition = Literal[
    "haptic",
    "non-haptic",
    "silent",
    "constant",
    "unrelated",
    "replayed",
    "permuted",
    "inverted",
    "half",
    "unfelt",
    "event-gated",
    "oracle",
    "true-force",
    "true-steps",
    "ideal-vest",
    "mistimed",
    "reflex",
    "haptic-reflex",
    "true-reflex",
]

CONDITIONS: tuple[Condition, ...] = get_args(Condition)
"""Haptic, non-haptic, the sham arms, event-gated, the positive controls, and the arms with a reflex."""

Reports: TypeAlias = Literal[
    "touch", "events", "true slips", "true force", "true force, equal steps", "true force, linear"
]
"""Content of the vest's frames: the loop's measurements, or the truth of the simulated world."""

WornOn: TypeAlias = Literal["own", "clear", "none"]
"""Skin that the motors reach: the person's own, one that misses nothing, or none."""


_OF_FRAMES: Final = frozenset({"informative", "permuted", "inverted", "half"})
"""Shams that make the worn frame from the frame that the loop made."""

ReflexReports: TypeAlias = Literal["none", "touch", "true slips"]
"""Source of a reflex's slips: the loop's measurements, or the world's truth."""


class Arm(NamedTuple):
    """One condition of a comparison.

    ``reports`` is the content of the frames, ``sham`` what changes them before they are worn
    (:func:`tega_sim.operator.sham_vest`), and ``reflex`` the source of a reflex's slips.
    """

    reports: Reports = "touch"
    sham: ShamName = "informative"
    skin: WornOn = "own"
    reflex: ReflexReports = "none"

    @property
    def pulses(self) -> bool:
        """Whether pulses announce events, which the person knows."""
        return self.reports in {"events", "true slips"}

    @property
    def hangs_on_pictures(self) -> bool:
        """Whether the worn frames, or the reflex, depend on the fingertips' camera frames."""
        return self.reflex == "touch" or (self.reports in {"touch", "events"} and self.sham in _OF_FRAMES)


ARMS: Final[dict[Condition, Arm]] = {
    "haptic": Arm(),
    "non-haptic": Arm(sham="off"),
    "silent": Arm(sham="silent"),
    "constant": Arm(sham="constant"),
    "unrelated": Arm(sham="unrelated"),
    "replayed": Arm(sham="replayed"),
    "permuted": Arm(sham="permuted"),
    "inverted": Arm(sham="inverted"),
    "half": Arm(sham="half"),
    "unfelt": Arm(skin="none"),
    "event-gated": Arm("events"),
    "oracle": Arm("true slips"),
    "true-force": Arm("true force"),
    "true-steps": Arm("true force, equal steps"),
    "ideal-vest": Arm("true force, linear", skin="clear"),
    "mistimed": Arm("true slips", sham="replayed"),
    "reflex": Arm(sham="off", reflex="touch"),
    "haptic-reflex": Arm(reflex="touch"),
    "true-reflex": Arm(sham="off", reflex="true slips"),
}
"""What each condition is."""

SESSION_CONDITIONS: tuple[Condition, ...] = tuple(name for name, arm in ARMS.items() if arm.skin == "own")
"""Those that one person can meet in one session: their own skin stays on."""
