"""Map contact values to equal steps of sensation, by Weber's law and the wearer's own detection thresholds."""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.haptics import FeltMap
from tega.records import Contact, Event
from tega.stages.base import StageOptions, VestSetup
from tega.stages.slip_row import SlipRowMapping, SlipRowOptions

THRESHOLD_PERCENT = 20.0
"""Detection threshold where the wearer's was not measured: 3 of a vest's 15 levels, one wearer; uncertain."""

WEBER = 0.3
"""Weber fraction where the wearer's step was not measured: the arm's medians are 0.20 to 0.58, the torso is worse."""


class EqualStepsOptions(SlipRowOptions, frozen=True):
    """Options of the mapping ``equal-steps``: those of ``slip-row``, and these.

    Attributes:
        law: Share of the sensation by the value: ``linear``, in proportion; ``logistic`` and ``power`` as in
            ``columns``.
        first_steps: So many noticeable steps above its threshold a motor begins.
        full_percent: Intensity of a motor at full sensation; where vest.options.limit is lower, give that.
    """

    law: Literal["logistic", "linear", "power"] = "linear"
    slip_row: Literal["bottom", "top", "none"] = "none"
    first_steps: Annotated[float, msgspec.Meta(ge=0, le=20)] = 1.0
    full_percent: Annotated[float, msgspec.Meta(gt=0, le=100)] = 100.0


class EqualStepsMapping(SlipRowMapping):
    """Columns with intensities that rise by equal steps of sensation.

    By Weber's law dI = W I is just noticed (Fechner 1860), so that n(I) = ln(I / T) / ln(1 + W) noticeable steps
    lie between the threshold T and I. A motor m shows the share s of full sensation at

    ``I = T_m (1 + W_m) ** (n1 + s (N - n1))``, ``N`` the least ``n(F)`` of all motors,

    and 0 at s = 0: wherever it is shown, a share is as many steps above the threshold, and N is that of the
    motor with the fewest (``n_steps``). ``n1`` is ``first_steps``, F ``full_percent``. T is vest.threshold, W
    vest.step over the intensity half way between threshold and F, where the step is measured; what was not
    measured is :data:`THRESHOLD_PERCENT` and :data:`WEBER`. Raises ``ConfigError`` as ``slip-row`` does, or if a
    motor's threshold is not below F.
    """

    summary: ClassVar[str] = (
        "columns in equal steps of sensation: Weber's law above the wearer's own thresholds"
    )
    options_type: ClassVar[type[StageOptions]] = EqualStepsOptions
    evens_out: ClassVar[bool] = True

    def __init__(self, setup: VestSetup, options: EqualStepsOptions) -> None:
        super().__init__(setup, options)
        numbers = setup.layout.numbers
        full = options.full_percent
        felt = setup.felt or FeltMap()
        threshold = np.where(felt.threshold > 0, felt.threshold, THRESHOLD_PERCENT)[numbers]
        step = felt.step[numbers]
        if (worst := float(threshold.max())) >= full:
            raise ConfigError(
                f"stages.mapping.options.full_percent = {full:g} is not above the threshold of every motor: "
                f"{worst:g} percent is felt at the worst",
                "raise it, or look at vest.threshold",
            )
        # 1 is the step of nobody in particular.
        weber = step / ((threshold + full) / 2) if (step != 1.0).any() else np.full(len(numbers), WEBER)
        log_weber, self._lowest = np.log1p(weber), threshold
        self.n_steps = float((np.log(full / threshold) / log_weber).min())
        first = min(options.first_steps, self.n_steps)
        # Of ln(I / T): at the lowest share, and what each percent adds; arrays cost less than numbers.
        self._begin, self._per_percent = first * log_weber, (self.n_steps - first) * log_weber / 100
        self._most = np.full(len(numbers), 100.0)

    def levels(
        self, t_ns: int, contacts: AnyMapping[str, Contact], events: Sequence[Event]
    ) -> NDArray[np.float64]:
        """Return every motor's level."""
        levels = super().levels(t_ns, contacts, events)
        if not np.count_nonzero(levels):  # this runs for every picture, and most motors rest most of the time
            return levels
        resting = ~(levels > 0)  # and what is no number
        np.minimum(levels, self._most, out=levels)
        levels *= self._per_percent
        levels += self._begin
        np.exp(levels, out=levels)
        levels *= self._lowest
        np.putmask(levels, resting, 0.0)
        return levels
