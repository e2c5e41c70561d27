"""Debounce buttons: a press counts once it has held, a release at once."""

from __future__ import annotations

from collections.abc import Iterator, Set
from typing import NamedTuple


class Edge(NamedTuple):
    """A button that went down or up; for a press ``t_ns`` is its first contact."""

    t_ns: int
    button: str
    pressed: bool


class Debounce:
    """Follows the contacts of some buttons; time is an argument.

    A dead-man switch must release at the first sign of a release, so a release counts at once and a bouncing
    contact counts as released. A press counts once the contact has held for ``hold_ns`` (0 takes every
    press), with the time of its first contact. Together they give one press for one step on a pedal with
    shorter bounces.
    """

    def __init__(self, hold_ns: int) -> None:
        self._hold_ns = hold_ns
        self._since: dict[str, int] = {}
        self.held: frozenset[str] = frozenset()

    def take(self, t_ns: int, down: Set[str]) -> Iterator[Edge]:
        """Process a report; yield the events that have become certain, in time order."""
        yield from self.settle(t_ns)
        for button in sorted(self._since.keys() - down):
            del self._since[button]
            if button in self.held:
                self.held -= {button}
                yield Edge(t_ns, button, pressed=False)
        for button in sorted(down - self._since.keys()):
            self._since[button] = t_ns
        yield from self.settle(t_ns)

    def settle(self, t_ns: int) -> Iterator[Edge]:
        """Let time pass; yield the presses that have held long enough."""
        for button, since_ns in sorted(self._since.items()):
            if button not in self.held and t_ns - since_ns >= self._hold_ns:
                self.held |= {button}
                yield Edge(since_ns, button, pressed=True)
