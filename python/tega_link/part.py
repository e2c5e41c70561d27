"""Join a run: the link puts the other station's devices in place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tega.runtime.threads import run_realtime
from tega_link.open_station import open_station

if TYPE_CHECKING:
    from tega.loop.parts import PartContext
    from tega_link.station import Station


def open_part(context: PartContext) -> Station | None:
    """Open this station's end of the link; ``None`` where the settings name no station."""
    if context.config.guests.get("net") is None:
        return None
    context.progress("opening the link", 0, 0)
    station = open_station(context.config, context.bus, stop=context.stop)
    # The link's own threads, for which the other station waits.
    with run_realtime("act", inherited=True):
        context.stack.enter_context(station)
    return station
