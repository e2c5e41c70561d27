"""Emphasise changes of touch on the vest: strong at onset and offset, weak while nothing changes, as skin does.

Fast-adapting afferents answer where a touch begins and ends, slowly adapting ones go on for as long as it lasts
(Johansson and Flanagan 2009, "Coding and use of tactile signals from the fingertips in object manipulation tasks",
doi 10.1038/nrn2621). A motor that runs on evenly is adapted to within minutes and uses up the wearer's dose.
"""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records import Contact
from tega.stages.base import StageOptions, VestSetup
from tega.stages.slip_row import SlipRowMapping, SlipRowOptions

# Long enough to be felt apart from an onset, which adapt_s ends.
_REMIND_NS = 1_000_000_000

_Gain = Annotated[float, msgspec.Meta(ge=0, le=10)]


class ChangesOptions(SlipRowOptions, frozen=True):
    """Options of the mapping ``changes``: those of ``slip-row``, and these.

    Attributes:
        steady: Share of the columns' level that is shown while nothing changes.
        onset: How strongly a rise is shown, per percent above the level that is adapted to.
        offset: How strongly a fall is shown, per percent below the level that is adapted to.
        adapt_s: Time constant with which the level that is adapted to follows.
        quiet_percent: A difference up to this counts as no change.
        remind_every_s: While nothing changes the steady level is shown for a second once in so long; 0: all the time.
    """

    slip_row: Literal["bottom", "top", "none"] = "none"
    steady: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.4
    onset: _Gain = 1.0
    offset: _Gain = 0.7
    adapt_s: Annotated[float, msgspec.Meta(ge=0.05, le=10)] = 0.4
    quiet_percent: Annotated[float, msgspec.Meta(gt=0, le=50)] = 5.0
    remind_every_s: Annotated[float, msgspec.Meta(ge=0, le=60)] = 0.0


class ChangesMapping(SlipRowMapping):
    """Columns that show changes strongly and a steady touch weakly.

    For the level p of a column that ``columns`` would show, the level adapted to follows as ``a' = (p - a) / adapt_s``,
    p being held from one refresh to the next, and e = p - a is the change. With q = ``quiet_percent``

    ``steady · p + onset · max(e - q, 0) + offset · max(-e - q, 0)``, held within 0 and 100,

    is shown. After a finger has let go, its column is silent from ``adapt_s · ln(p / q)`` on. A finger that appears
    for the first time, or after a while, starts as adapted: its first value is no change.
    """

    summary: ClassVar[str] = (
        "columns that show changes: strong at onset and offset, weak while touch is steady"
    )
    options_type: ClassVar[type[StageOptions]] = ChangesOptions

    def __init__(self, setup: VestSetup, options: ChangesOptions) -> None:
        super().__init__(setup, options)
        self._change = options
        n_values = 2 * len(self._fingers) + 1
        self._level = np.zeros(n_values)
        self._adapted = np.zeros(n_values)
        self._changed_ns = np.zeros(n_values, np.int64)
        self._seen: frozenset[str] = frozenset()
        self._t_ns = 0

    def _values(self, t_ns: int, contacts: AnyMapping[str, Contact]) -> NDArray[np.float64]:
        o = self._change
        level = np.minimum(super()._values(t_ns, contacts), 100)
        gone_s = max(0, t_ns - self._t_ns) * 1e-9
        self._t_ns = max(t_ns, self._t_ns)
        # What was shown until now is what was adapted to until now.
        self._adapted = self._level + (self._adapted - self._level) * np.exp(-gone_s / o.adapt_s)
        self._level = level
        for n, finger in enumerate(self._fingers):
            both = slice(2 * n, 2 * n + 2)
            if finger not in self._seen or finger not in contacts:
                self._adapted[both] = level[both]
                self._changed_ns[both] = self._t_ns
        self._seen = frozenset(contacts)
        change = level - self._adapted
        beyond = np.maximum(np.abs(change) - o.quiet_percent, 0)
        self._changed_ns[beyond > 0] = self._t_ns
        steady = o.steady * level
        if o.remind_every_s:
            since_ns = (self._t_ns - self._changed_ns) % round(o.remind_every_s * 1e9)
            steady[since_ns >= _REMIND_NS] = 0.0
        gain = np.where(change > 0, o.onset, o.offset)
        displayed: NDArray[np.float64] = np.minimum(steady + gain * beyond, 100)
        return displayed
