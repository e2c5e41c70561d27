"""Stream a run live to the Foxglove app: all that a recording would hold, while it happens."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any, Final, Self

from tega.errors import DeviceUnavailableError
from tega.recording.record_channels import RecordChannels
from tega.records import HandExchange, Record
from tega.records.bus import Backlog, Bus
from tega.records.types import record_types
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime
from tega.ui.view.same_machine import SameMachine, hidden_address

FOXGLOVE_PORT: Final = 8765
"""Default port of the app."""

# The app in a browser, and on the desktop.
_APP: Final = ("https://app.foxglove.dev", "file://")
# Records that may wait; the run never does.
_MOST = 2048


class FoxgloveStream:
    """Serves a run's records on a websocket of this machine; use as a context manager.

    Programs of this machine and the app can read the stream. Pages of other sites that are open in the same
    browser, and other names of this machine, are refused. Nothing can be changed by it.
    ``python/tega_viewers/foxglove-layout.json`` is a layout for the app. A ``port`` of 0 takes any free one;
    ``url`` is what the app needs, empty while closed.
    """

    def __init__(self, bus: Bus, *, port: int = FOXGLOVE_PORT) -> None:
        self._bus, self._port = bus, port
        self._channels: RecordChannels
        self._serving = ExitStack()
        self._backlog = Backlog("foxglove", most=_MOST, newest=True, rank=run_realtime("beside"))
        self.url = ""

    def __enter__(self) -> Self:
        """Start the server and subscribe to the run; ``DeviceUnavailableError`` if the port is taken."""
        foxglove = require("foxglove", driver="foxglove", extra="record")
        self._channels = RecordChannels(lossless=False, jpeg_quality=80)
        address = hidden_address()
        with ExitStack() as starting:
            try:
                server: Any = foxglove.start_server(
                    name="TEGA", host=address, port=0, context=self._channels.context
                )
                starting.callback(server.stop)
                self._front = SameMachine(self._port, behind=(address, server.port), allowed=_APP)
                starting.callback(self._front.close)
            except (OSError, RuntimeError) as error:
                raise DeviceUnavailableError(
                    f"foxglove: port {self._port} cannot be served: {error}", "end the program that has it"
                ) from error
            self._serving = starting.pop_all()
        self.url = f"ws://127.0.0.1:{self._front.port}"
        for kind in record_types():
            # A hand's exchanges are stamped by another clock until the session has started; unless somebody else wants
            # them they are not even made.
            if kind.topic and kind is not HandExchange:
                self._bus.subscribe(kind, self._take, name="foxglove", backlog=self._backlog)
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop serving."""
        self._backlog.close()
        self.url = ""
        self._serving.close()

    def _take(self, record: Record) -> None:
        channels = self._channels
        if not self.url:
            return
        if channels.epoch_ns == 0:
            channels.epoch_ns = time.time_ns() - record.log_ns
        channels.write(record, record.log_ns)
