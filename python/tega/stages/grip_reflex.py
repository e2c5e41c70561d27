"""Ask for a firmer grip at incipient slip and take it back before harm, based on the fingertips."""

from __future__ import annotations

import math
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import Annotated, Final

import msgspec

from tega.records import Contact, Event
from tega.stages.base import Reflex, ReflexSetup, StageOptions

# The wish fades over the last fifth of the way to a limit, so that it neither jumps nor chatters there.
_MARGIN: Final = 0.2


class GripReflexOptions(StageOptions, frozen=True):
    """Options of ``grip``.

    Attributes:
        incipient_from: Share of a contact's rim that slips, from which on the grip is to be firmer; at 1, fully.
        full_slip_mm_s: Speed of a slip at which the grip is to be firmer by all that may be added.
        events: Whether a slip detected from events counts, for fingers with a metric that measures neither of the
            two.
        keep_s: Time by which a wish outlasts its cause, seconds.
        most_give_levels: Closure gained since the first touch at which nothing is added any more, levels, as the
            object is giving way. 0 for no such limit.
        most_force_n: Force on a fingertip at which nothing is added any more, newtons; 0 for no such limit. A touch
            whose force is not measured counts as that force.
    """

    incipient_from: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.4
    full_slip_mm_s: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 5.0
    events: bool = True
    keep_s: Annotated[float, msgspec.Meta(ge=0, le=5)] = 0.5
    most_give_levels: Annotated[float, msgspec.Meta(ge=0, le=4)] = 1.2
    most_force_n: Annotated[float, msgspec.Meta(ge=0, le=100)] = 0.0


class GripReflex(Reflex):
    """Firms the grip by how far the worst finger slips, and takes it back where the object gives or a finger is loaded.

    A slip is detected from a contact's named values ``incipient`` (share of the rim that slips, 0 to 1) and
    ``slip_mm_s`` if its metric provides them, else from slip events. Harm is near if the closure has gained
    ``most_give_levels`` since the first touch, or a finger bears ``most_force_n``. The wish is then the slip's, times
    the remaining part of the last fifth of the way there. Beyond the limit it is below 0, which takes back the
    addition.
    """

    summary = "firmer at incipient slip, eased where the object gives or a finger is loaded"
    options_type = GripReflexOptions

    def __init__(self, setup: ReflexSetup, options: GripReflexOptions) -> None:
        self._fingers, self._o = setup.fingers, options
        self.wants_events = options.events
        self._first: float | None = None
        self._requested, self._until_ns = 0.0, 0
        self._why = self._cause = ""

    @property
    def cause(self) -> str:
        """Reason of the newest wish."""
        return self._cause

    def wish(
        self,
        t_ns: int,
        own: float,  # noqa: ARG002  # what the person asks is no sign of a slip
        measured: float | None,
        contacts: AnyMapping[str, Contact],
        events: Sequence[Event],
    ) -> float:
        """Return the wish, see :meth:`tega.stages.Reflex.wish`."""
        touching = [
            contacts[name] for name in self._fingers if name in contacts and contacts[name].in_contact
        ]
        if not touching:
            self._first, self._requested, self._cause = None, 0.0, ""
            return 0.0
        if self._first is None:
            self._first = measured
        self._check(t_ns, touching, events)
        room = self._room(touching, measured)
        if room <= 0:
            self._requested = 0.0
            return room
        requested = self._requested if t_ns <= self._until_ns else 0.0
        self._cause = self._why if requested > 0 else ""
        return requested * room

    def _check(self, t_ns: int, touching: Sequence[Contact], events: Sequence[Event]) -> None:
        """Keep the strongest sign of a slip until it has been over for a while."""
        slips = {contact.finger: self._slips(contact) for contact in touching}
        signs = [(share, finger) for finger, share in slips.items() if share is not None]
        silent = slips.keys() - {finger for _, finger in signs}
        if self._o.events:
            signs += [
                (event.confidence, event.finger or "hand")
                for event in events
                if event.kind == "slip" and (event.finger in silent or (not event.finger and silent))
            ]
        strongest, finger = max(signs, key=lambda sign: sign[0], default=(0.0, ""))
        if t_ns > self._until_ns:
            self._requested = 0.0
        if strongest > 0 and strongest >= self._requested:
            self._requested, self._until_ns = min(strongest, 1.0), t_ns + round(self._o.keep_s * 1e9)
            self._why = f"slip, {finger}"

    def _slips(self, contact: Contact) -> float | None:
        """Strength of a finger's slip by its metric's own values, 0 to 1; ``None`` where it has none of a slip."""
        o, found = self._o, dict[str, float]()
        for one in contact.more:
            if one.name == "incipient":
                found[one.name] = (one.value - o.incipient_from) / (1 - o.incipient_from)
            elif one.name == "slip_mm_s":
                found[one.name] = abs(one.value) / o.full_slip_mm_s
        return min(max([0.0, *filter(math.isfinite, found.values())]), 1.0) if found else None

    def _room(self, touching: Sequence[Contact], measured: float | None) -> float:
        """Room before harm: 1 far from it, 0 at the limit, -1 well beyond it."""
        o, room = self._o, 1.0
        if o.most_give_levels > 0 and measured is not None and self._first is not None:
            gained = measured - self._first
            room = min(room, (o.most_give_levels - gained) / (_MARGIN * o.most_give_levels))
            if room < 1:
                self._cause = "eased: the object gives"
        if o.most_force_n > 0:
            forces_n = [math.nan if c.force_n is None else c.force_n for c in touching]
            known_n = [force_n for force_n in forces_n if not math.isnan(force_n)]
            most_n = max([*known_n, o.most_force_n if len(known_n) < len(forces_n) else 0.0])
            left = (o.most_force_n - most_n) / (_MARGIN * o.most_force_n)
            if left < room:
                why = "eased: a finger is loaded" if most_n in known_n else "no force is measured"
                room, self._cause = left, why
        return max(room, -1.0)
