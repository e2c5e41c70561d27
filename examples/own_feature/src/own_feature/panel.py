"""Show the count on page and terminal."""

from __future__ import annotations

from own_feature.records import Grip
from tega.records.bus import Bus
from tega.records.display import DisplayRow


def show_grip(bus: Bus) -> None:
    """Publish a row for each record of the count."""

    def show(grip: Grip) -> None:
        bus.publish(DisplayRow(name="grip", text=f"{grip.fingers} fingers{', firm' if grip.firm else ''}"))

    bus.subscribe(Grip, show, name="grip row")
