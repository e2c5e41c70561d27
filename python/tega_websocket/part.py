"""Join a run: serve its records, and let a client lead where the settings allow it."""

from __future__ import annotations

import base64
import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, Final

import tega
from tega.loop.inbox.inputs import Inputs
from tega.loop.parts import PartContext, RunStart
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import HandExchange, HeardMarker, Picture, Record
from tega.records.bus import Backlog
from tega.records.display import Notice
from tega.records.types import record_types
from tega.runtime.marker_budget import MarkerBudget
from tega.runtime.opencv import load_cv2
from tega.runtime.threads import run_realtime
from tega.ui.view.same_machine import url_host
from tega_websocket.commands import CommandedPart, Commands
from tega_websocket.messages import (
    PROTOCOL,
    Mark,
    MessageError,
    Release,
    decode,
    encode,
    encode_record,
    field_units,
)
from tega_websocket.server import Served, Server
from tega_websocket.settings import WebSocketTable, read_token

_MOST_WAITING: Final = 2048
_JPEG_QUALITY: Final = 80


class WebSocketPart(CommandedPart):
    """The server of one run."""

    def __init__(self, context: PartContext, table: WebSocketTable) -> None:
        config, self._bus, self._table = context.config, context.bus, table
        arm = config.arm.mapping.frame if table.arm and config.arm is not None else None
        super().__init__(Commands(ttl_ms=table.ttl_ms, hand=table.hand, arm=arm))
        self._token = secrets.token_urlsafe(16) if table.token_file is None else read_token(table.token_file)
        served = Served(self._welcome, self._state, self._command, self._commands.release)
        self._server = Server(
            self._token, served, origins=table.origins, remote=not table.on_this_machine, buffer=table.buffer
        )
        self._start_ns: int | None = None
        self._view: LoopView | None = None
        self._cv2 = load_cv2("websocket") if table.pictures_hz else None
        self._picture_ns: dict[str, int] = {}
        self._n_marks, self._budget = 0, MarkerBudget()
        backlog = Backlog("websocket", most=_MOST_WAITING, newest=True, rank=run_realtime("beside"))
        for kind in record_types():
            # A hand's exchanges are stamped by another clock, and are not made unless a recording wants them.
            if kind.topic and kind is not HandExchange and (kind is not Picture or self._cv2 is not None):
                self._bus.subscribe(kind, self._send, name="websocket", backlog=backlog)
        self._bus.subscribe(Snapshot, self._seen, name="websocket")
        context.stack.callback(backlog.close)

    def needs(self) -> Mapping[str, Callable[[], str]]:
        """Return the need of a client that leads the hand."""
        return {"websocket": self._commands.missing} if self._commands.hand else {}

    def open(self) -> None:
        """Serve, and print the address."""
        table = self._table
        self._server.open(table.host, table.port)
        token = self._token if table.token_file is None else "TOKEN"
        self._bus.publish(Notice(text=f"websocket: ws://{url_host(table.host)}:{self._server.port}/{token}"))

    def close(self) -> None:
        """End all connections."""
        self._server.close()

    # The run's side.

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:  # noqa: ARG002
        """Return the switches, with a client's for those that the settings do not name."""
        seats = self._commands.seats()
        return Inputs({**seats, **inputs.seats}) if seats else inputs

    def begin(self, run: RunStart) -> None:
        """Obey from now on."""
        super().begin(run)
        self._start_ns = run.start_ns if run.real else time.monotonic_ns()

    def summary(self) -> dict[str, Any]:
        """Return the counts of clients and commands."""
        commands, server = self._commands, self._server
        counts = {"clients": server.n_clients, "dropped": server.n_dropped, "commands": commands.n}
        return {"websocket": counts | {"refused": dict(commands.refused), "markers": self._n_marks}}

    def _seen(self, snapshot: Snapshot) -> None:
        self._view = snapshot.view

    def _send(self, record: Record) -> None:
        """Send a record, in the backlog's thread."""
        if not self._server.busy or not self._table.sends(record.where):
            return
        if not isinstance(record, Picture):
            self._server.send(encode_record(record))
        elif record.t_ns >= self._picture_ns.get(record.finger, 0) and self._cv2 is not None:
            self._picture_ns[record.finger] = record.t_ns + round(1e9 / self._table.pictures_hz)
            quality = [self._cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
            _, jpeg = self._cv2.imencode(".jpg", record.image, quality)
            self._server.send(encode_record(record, jpeg=base64.b64encode(jpeg.tobytes()).decode()))

    # The server's side, in its thread.

    def _now_ns(self) -> int | None:
        return None if self._start_ns is None else time.monotonic_ns() - self._start_ns

    def _welcome(self, client: int) -> bytes:
        table = self._table
        allowed = [name for name in ("hand", "arm") if getattr(table, name)]
        facts = {"protocol": PROTOCOL, "tega": str(tega.__version__), "client": client, "allowed": allowed}
        return encode("Welcome", facts | {"ttl_ms": table.ttl_ms, "units": field_units(record_types())})

    def _state(self, n_dropped: int) -> bytes:
        view = self._view
        content: dict[str, Any] = {"t_ns": self._now_ns(), "state": "", "reason": "", "alerts": ()}
        if view is not None:
            content |= {"state": view.state, "reason": view.reason, "alerts": view.alerts}
            content |= {"joints_rad": view.angles_rad, "arm": view.arm}
            content["arm_hand_m"] = None if view.seen_arm is None else view.seen_arm.hand_m
            content["touch"] = {finger: one.cci_norm for finger, one in view.felt.items()}
        return encode("State", content | {"dropped": n_dropped})

    def _command(self, client: int, data: str | bytes) -> None:
        try:
            command = decode(data)
        except MessageError:
            self._commands.refused["malformed"] += 1
            raise
        if isinstance(command, Release):
            self._commands.release(client)
        elif isinstance(command, Mark):
            self._mark(client, command.text)
        else:
            self._commands.obey(client, command)

    def _mark(self, client: int, text: str) -> None:
        now_ns = self._now_ns()
        if why := self._budget.problem(text):
            self._commands.refused["too many markers"] += 1
            raise MessageError(why)
        if now_ns is not None:
            self._n_marks += 1
            self._bus.publish(
                HeardMarker(t_ns=now_ns, received_ns=now_ns, text=text, source=f"websocket:{client}")
            )


def open_part(context: PartContext) -> WebSocketPart | None:
    """Open the server; ``None`` where the settings have no table ``[websocket]``."""
    table = context.config.guests.get("websocket")
    if table is None:
        return None
    part = WebSocketPart(context, table)
    context.stack.callback(part.close)
    part.open()
    return part
