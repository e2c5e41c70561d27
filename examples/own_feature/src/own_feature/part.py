"""Join a run: count the fingers in contact from the contacts on the bus."""

from __future__ import annotations

from typing import Any

from own_feature.records import Grip
from own_feature.settings import GripTable
from tega.loop.parts import Part, PartContext
from tega.records import Contact


class GripPart(Part):
    """Counts the fingers in contact, and publishes every change."""

    def __init__(self, context: PartContext, table: GripTable) -> None:
        self._bus, self._table = context.bus, table
        self._touching: set[str] = set()
        self._n_firm = 0
        context.bus.subscribe(Contact, self._contact, name="grip")

    def _contact(self, contact: Contact) -> None:
        before = len(self._touching)
        (self._touching.add if contact.in_contact else self._touching.discard)(contact.finger)
        if (now := len(self._touching)) != before:
            firm = now >= self._table.firm_from
            self._n_firm += firm and before < self._table.firm_from
            self._bus.publish(Grip(t_ns=contact.t_ns, fingers=now, firm=firm))

    def summary(self) -> dict[str, Any]:
        """Return the number of firm grips."""
        return {"grip": {"firm": self._n_firm}}


def open_part(context: PartContext) -> GripPart | None:
    """Return the count; ``None`` where the settings have no table ``[grip]``."""
    table = context.config.guests.get("grip")
    return None if table is None else GripPart(context, table)
