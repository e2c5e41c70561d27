"""Show, for a recording that is played, the parts without a sink: the arm's state and the markers."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import TYPE_CHECKING, Any

from tega.arm.messages import Health
from tega.loop.arm_view import ArmView
from tega.loop.parts import Part
from tega.records import ArmTurn, Marker

if TYPE_CHECKING:
    from tega.loop.moment import LoopView
    from tega.recording.replay.playhead import Playhead
    from tega.recording.replay.recorded import Recorded
    from tega.records.bus import Bus

PLAYED = "recording"
"""Source of a marker that is published again."""


class PlayedBeside(Part):
    """Follows the playhead through an arm's turns and through the markers; nothing of it moves an arm.

    Args:
        recorded: The recording.
        playhead: Position of the playback.
        bus: Each marker is published here when it passes; a jump publishes none.
    """

    def __init__(self, recorded: Recorded, playhead: Playhead, bus: Bus) -> None:
        self._turns = recorded.of(ArmTurn)
        self._markers = sorted((marker.t_ns, marker.text) for marker in recorded.of(Marker))
        self._turns_ns = [turn.t_ns for turn in self._turns]
        self._playhead, self._bus = playhead, bus
        self._n_jumps, self._passed_ns = playhead.n_jumps, playhead.from_ns - 1
        self._at_ns = playhead.from_ns
        playhead.fills.append(self.fill)

    def fill(self, t_ns: int) -> None:
        """Update the position for a time of the run, and publish the markers that have passed."""
        at_ns = t_ns - self._playhead.shift_ns
        if self._n_jumps != self._playhead.n_jumps:
            self._n_jumps, self._passed_ns = self._playhead.n_jumps, at_ns - 1
        self._at_ns = at_ns
        times = [marker[0] for marker in self._markers]
        for marked_ns, text in self._markers[
            bisect_right(times, self._passed_ns) : bisect_right(times, at_ns)
        ]:
            shifted_ns = marked_ns + self._playhead.shift_ns
            self._bus.publish(Marker(t_ns=shifted_ns, text=text, source=PLAYED))
        self._passed_ns = max(self._passed_ns, at_ns)

    def shown(self, view: LoopView) -> LoopView:
        """Add the recorded state of the arm to a view of the loop."""
        place = bisect_right(self._turns_ns, self._at_ns)
        if not place:
            return view
        seen = _seen(self._turns[place - 1])
        height_m = None if seen.hand_m is None else seen.hand_m[2]
        words = f"as recorded: {seen.state}: {seen.reason}"
        return view._replace(arm=words, seen_arm=seen, arm_height_m=height_m)


def _seen(turn: Any) -> ArmView:
    hand_m = behind_mm = None
    if turn.measured and len(place := tuple(turn.measured[0].position)) == 3:
        hand_m = place
        if len(turn.target) == 7:
            behind_mm = 1e3 * math.dist(place, turn.target[:3])
    return ArmView(
        turn.state, turn.reason, turn.phase, turn.clutch, turn.dead_man, hand_m, behind_mm, Health()
    )
