"""Join a run: the link puts the other station's devices in place."""

from __future__ import annotations

from collections.abc import Callable

from tega.config import SessionConfig
from tega.errors import ConfigError
from tega.loop.parts import PartContext
from tega.records.bus import Bus
from tega.records.display import Notice
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime
from tega_link.operator import OperatorStation
from tega_link.robot import RobotStation
from tega_link.settings import net_of
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


def open_station(config: SessionConfig, bus: Bus, *, stop: Callable[[], bool]) -> Station:
    """Make this station's end of the link, not opened yet."""
    net = net_of(config)
    assert net is not None
    if config.session.pace == "fast":
        raise ConfigError(
            "session.pace = 'fast', but a station runs in real time", "set session.pace = 'real'"
        )
    operator = net.station == "operator"
    here = {
        "tactile": bool(config.tactile),
        "hand": config.hand.driver is not None,
        "arm": config.arm is not None,
    }
    if not operator:
        here = {
            "emg": config.emg is not None,
            "vest": config.vest.driver is not None,
            "input": bool(config.input.in_use()),
            "arm.tracker": config.arm is not None and config.arm.tracker is not None,
            "net.tracker": net.tracker is not None,
        }
    other = "robot" if operator else "operator"
    for table in (table for table, is_there in here.items() if is_there):
        raise ConfigError(
            f"[{table}] stands in the {net.station}'s settings, but belongs to the {other}",
            f"move it to the settings of the {other}'s station",
        )
    if net.keys is not None:
        require("cryptography", driver="tega-teleop net keys", extra="net")
        from tega_link.keys import check_expiry

        if message := check_expiry(net.keys):
            bus.publish(Notice(text=message))
    if operator:
        return OperatorStation(config, bus, stop)
    return RobotStation(config, bus)
