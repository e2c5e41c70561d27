"""Compare the evidence that a live stream carries about itself with the assumptions of its driver: one rule for all.

=============  ==========================================================================================
evidence       what is compared
=============  ==========================================================================================
``counter``    the device's own number of each packet, with one more than the packet before
``banner``     the device's description of itself, with the device that the settings name
``stamp``      the sender's time of each item, with the time at which the item arrived
``rate``       the measured rate, with the stated rate
``values``     the numbers or pictures themselves, with the range, the columns and the size that were agreed
=============  ==========================================================================================

Where the samples cannot be used, the driver raises :class:`StreamContradictionError`: opening is refused, and a running
source is lost. Where they can, the driver reports a :class:`Contradiction` among its ``faults``: ``doctor`` calls it
wrong, the terminal and the page show it as an alert, and the recording keeps the alert. Every driver lists in its
``compared`` the evidence that its stream carries.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple, NoReturn, get_args

from tega.errors import StreamContradictionError

Evidence = Literal["counter", "banner", "stamp", "rate", "values"]
"""Evidence that a stream can carry about itself."""

EVIDENCE: Final[tuple[Evidence, ...]] = get_args(Evidence)
"""The names of all kinds of evidence."""


class Contradiction(NamedTuple):
    """Difference between a stream's ``evidence`` and its driver's assumption; ``found`` has the numbers."""

    evidence: Evidence
    found: str
    hint: str = ""

    def __str__(self) -> str:
        """Return one sentence that begins with the name of the evidence."""
        return f"{self.evidence}: {self.found}"


def refuse(driver: str, label: str, contradiction: Contradiction) -> NoReturn:
    """Refuse a stream with unusable samples: always raises ``StreamContradictionError``."""
    raise StreamContradictionError(f"{driver}: {label}: {contradiction}", contradiction.hint)


class Contradictions:
    """Contradictions of one open stream that leave its samples usable.

    ``now`` are those that hold at present, ``seen`` those that held at any time since the stream was opened.
    """

    def __init__(self) -> None:
        self._now: dict[str, Contradiction] = {}
        self.now: tuple[Contradiction, ...] = ()
        self.seen: tuple[Contradiction, ...] = ()

    def note(self, name: str, contradiction: Contradiction | None) -> None:
        """Note the result of one comparison."""
        if self._now.get(name) == contradiction:
            return
        if contradiction is None:
            del self._now[name]
        else:
            self._now[name] = contradiction
            # A number in the words may change; one comparison is kept once.
            others = [one for one in self.seen if one.evidence != contradiction.evidence]
            self.seen = (*others, contradiction)
        self.now = tuple(self._now.values())
