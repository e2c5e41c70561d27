"""Show a slip as bursts on a row of motors of its own, beside columns that show touch.

A burst on top of a strong column is hard to distinguish from a firmer touch. Motors that carry nothing else show a
slip by place alone, which the torso distinguishes far better than intensity. People act fastest on a discrete cue of
slip (Aboseria and others 2018, "Discrete vibro-tactile feedback prevents object slippage in hand prostheses").
"""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import ClassVar, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.records import Contact, Event
from tega.stages.base import StageOptions, VestSetup
from tega.stages.columns import ColumnsMapping, ColumnsOptions

_PERCENT: Final = 100.0
"""Intensity of a burst: the row carries nothing else, so nothing is hidden by it."""
_BURSTS: Final = 2
"""Bursts of one slip: one alone could be the noise of a motor."""
_BURST_NS: Final = 150_000_000
"""Length of a burst: a small coin motor needs about 0.18 s to reach its full vibration."""
_PERIOD_NS: Final = _BURST_NS + 100_000_000
"""From one burst to the next, long enough that two bursts are distinguished."""
_AGAIN_NS: Final = 300_000_000
"""So soon after the last burst the same finger's slip is not shown again."""


class SlipRowOptions(ColumnsOptions, frozen=True):
    """Options of the mapping ``slip-row``: those of ``columns``, and these.

    Attributes:
        slip_row: Row of every face that shows slips and nothing else; ``none``: no slip is shown.
    """

    slip_row: Literal["bottom", "top", "none"] = "bottom"


class _Reported(NamedTuple):
    began_ns: int
    end_ns: int
    finger: str


class SlipRowMapping(ColumnsMapping):
    """Columns as in ``columns``, and a row of motors that carries slips alone, those that are certain.

    A rig without the hand's joints and the arm's height cannot observe slips: its row stays silent. A slip of
    one finger is shown in that finger's column of the row, one of the whole hand in those of all fingers that
    are seen. For a burst's length b and rest r it is on while ``(t - t_event) mod (b + r) < b``, n times.
    Raises ``ConfigError`` as ``columns`` does, or if a face has one row only, of which none can be spared.
    """

    summary: ClassVar[str] = "columns, and slips as bursts on a row of their own"
    options_type: ClassVar[type[StageOptions]] = SlipRowOptions

    def __init__(self, setup: VestSetup, options: SlipRowOptions) -> None:
        super().__init__(setup, options)
        self.wants_events = options.slip_row != "none"
        self._reported: list[_Reported] = []
        motors, rows = setup.layout.motors, setup.layout.rows
        last = {"bottom": 1, "top": 0}.get(options.slip_row)
        self._spared = np.array(
            [last is not None and motor.row == last * (rows(motor.face) - 1) for motor in motors]
        )
        self._motor_column = np.array([motor.column for motor in motors])
        if last is None:
            return
        for face in ("front", "back"):
            if rows(face) == 1:
                raise ConfigError(
                    f"layout {setup.layout.name!r} has one row at its {face}: none can be kept for slips",
                    'stages.mapping.options.slip_row = "none"',
                )
        # The columns have one row less, and a bar stands on what is left of them.
        self._displayed[:, self._spared] = 2 * len(self._fingers)
        self._rows -= 1
        self._below -= last
        self._below[self._spared] = 0

    def levels(
        self, t_ns: int, contacts: AnyMapping[str, Contact], events: Sequence[Event]
    ) -> NDArray[np.float64]:
        """Return every motor's level."""
        levels = super().levels(t_ns, contacts, events)
        if self.wants_events:
            self._notify(t_ns, events)
            for reported in self._reported:
                self._show(reported, t_ns, contacts, levels)
        return levels

    def _notify(self, t_ns: int, events: Sequence[Event]) -> None:
        lasts_ns = (_BURSTS - 1) * _PERIOD_NS + _BURST_NS
        for event in events:
            shown = any(
                one.finger == event.finger and event.t_ns < one.end_ns + _AGAIN_NS for one in self._reported
            )
            if event.kind == "slip" and event.certain and not shown:
                self._reported.append(_Reported(event.t_ns, event.t_ns + lasts_ns, event.finger))
        self._reported = [reported for reported in self._reported if t_ns < reported.end_ns + _AGAIN_NS]

    def _show(
        self, reported: _Reported, t_ns: int, contacts: AnyMapping[str, Contact], levels: NDArray[np.float64]
    ) -> None:
        """Set the motor levels of a slip at a given time; a finger without a fresh frame shows nothing."""
        since_ns = t_ns - reported.began_ns
        if since_ns < 0 or t_ns >= reported.end_ns or since_ns % _PERIOD_NS >= _BURST_NS:
            return
        for finger in contacts:
            if reported.finger in {"", finger} and finger in self._columns_of:
                lit = self._spared & (self._motor_column == self._columns_of[finger])
                levels[lit] = _PERCENT
