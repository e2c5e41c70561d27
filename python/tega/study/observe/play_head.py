"""Move a play head through a recorded trial: pause, seek, change speed, and know what was played."""

from __future__ import annotations

SPEEDS = (0.5, 1.0, 2.0)
"""Seconds of the trial a second."""

_MOST_NS = 500_000_000
"""A machine that shows nothing for longer has not shown what it missed: the head waits there."""


class PlayHead:
    """A position in a trial. Times of the clock and positions are nanoseconds; it begins at 0, standing still.

    Args:
        length_ns: Of the trial.

    Attributes:
        length_ns: Of the trial.
        playing: Whether it moves.
        speed: One of :data:`SPEEDS`.
        played: Stretches of the trial that were played through, from and to, rising, apart from one another.
    """

    def __init__(self, length_ns: int) -> None:
        self.length_ns = length_ns
        self.playing = False
        self.speed = 1.0
        self.played: list[tuple[int, int]] = []
        self._base_ns = self._since_ns = self._shown_ns = self._looked_ns = 0

    @property
    def seen_end(self) -> bool:
        """Whether the last moment was played."""
        return bool(self.played) and self.played[-1][1] == self.length_ns

    @property
    def missed_ns(self) -> int:
        """Time that was never played, nanoseconds."""
        return self.length_ns - sum(end - begin for begin, end in self.played)

    def at(self, t_ns: int) -> int:
        """Return the position at a moment of the clock, which may lie a little before the last look."""
        if not self.playing:
            return self._base_ns
        gone_ns = max(min(t_ns, self._looked_ns + _MOST_NS) - self._since_ns, 0)
        return min(self._base_ns + round(gone_ns * self.speed), self.length_ns)

    def look(self, t_ns: int) -> int:
        """Move to a moment of the clock and return the position; what lies between has been played."""
        at_ns = self.at(t_ns)
        if self.playing:
            self._note(at_ns)
            if at_ns == self.length_ns:
                self.playing = False
                self._put(at_ns, t_ns)
            elif t_ns > self._looked_ns + _MOST_NS:
                self._put(at_ns, t_ns)
        self._looked_ns = max(t_ns, self._looked_ns)
        return at_ns

    def toggle(self, t_ns: int) -> bool:
        """Play or pause; ``False`` at the end, where there is nothing to play."""
        at_ns = self.look(t_ns)
        if at_ns == self.length_ns:
            return False
        self._put(at_ns, t_ns)
        self.playing = not self.playing
        return True

    def pause(self, t_ns: int) -> None:
        """Stand still."""
        self._put(self.look(t_ns), t_ns)
        self.playing = False

    def seek(self, by_ns: int, t_ns: int) -> None:
        """Go on or back without playing what lies between."""
        self._put(min(max(self.look(t_ns) + by_ns, 0), self.length_ns), t_ns)

    def step_speed(self, by: int, t_ns: int) -> None:
        """Take the next faster or slower speed, where there is one."""
        self._put(self.look(t_ns), t_ns)
        self.speed = SPEEDS[min(max(SPEEDS.index(self.speed) + by, 0), len(SPEEDS) - 1)]

    def _put(self, at_ns: int, t_ns: int) -> None:
        self._base_ns = self._shown_ns = at_ns
        self._since_ns = self._looked_ns = t_ns

    def _note(self, at_ns: int) -> None:
        """Add what was played since the last look, joined with what it touches."""
        begin, end = self._shown_ns, max(at_ns, self._shown_ns)
        if end == begin:
            return
        touching = [one for one in self.played if one[0] <= end and one[1] >= begin]
        apart = [one for one in self.played if one not in touching]
        whole = min([begin, *(one[0] for one in touching)]), max([end, *(one[1] for one in touching)])
        self.played = sorted([*apart, whole])
        self._shown_ns = end
