"""Define an output of the loop."""

from __future__ import annotations

from typing import Protocol, TypeVar

Sent_contra = TypeVar("Sent_contra", contravariant=True)


class Sink(Protocol[Sent_contra]):
    """Output of the loop: a vest or a hand's bus, real, recorded or simulated."""

    def write(self, t_ns: int, sent: Sent_contra, /) -> object:
        """Write an output of the loop, with its time since the start of the session."""
        ...
