"""An emulated bHaptics Player: versions 2 and 3 of its websocket, strictly checked, with a vest that remembers.

Run ``python -m tega_emulators.bhaptics_player [--port 15881] [--port-v3 15882]`` and any client of the Player can talk
to it; version 3 (:mod:`~tega_emulators.player_v3`) is served only where its port is given, 0 for any free one.
Written from what the vendor's and others' open clients send. Keys that are not theirs, numbers out of their ranges
and wrong types are counted as errors, where the real Player says nothing.
Two keys on one motor: the larger intensity (not known of the real one).

Faults: ``close`` (ends every connection with code 1001), ``drop`` (without a word), ``freeze`` (reads nothing),
``slow`` (reads a message in 150 ms), ``garbage`` (its messages are no status), ``wrong-version`` (HTTP 404), ``refuse``
(HTTP 503), ``no-vest``, ``no-pong`` (answers no pings), ``no-entry`` (version 3 lets nobody in), ``flat`` (the vest's
battery is at 9 %).
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import logging
import ssl
import time
from http import HTTPStatus
from typing import Any, ClassVar
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.frames import Opcode
from websockets.http11 import Request, Response

from tega_emulators import vest_process
from tega_emulators.player_v3 import read_v3, server_tls, told_v3
from tega_emulators.vest_process import Motors

_POSITIONS = (
    "Vest",
    "VestFront",
    "VestBack",
    "Head",
    "ForearmL",
    "ForearmR",
    "HandL",
    "HandR",
    "FootL",
    "FootR",
)
_PANELS = {"VestFront": 0, "VestBack": 20}
_GARBAGE = ("not json {", "[1,2,3]", '{"ConnectedPositions":7}', '{"Status":"loud"}', b"\x00\xff\x13")
_SLOW_S = 0.15


class Player:
    """The Player and its vest."""

    faults: ClassVar[tuple[str, ...]] = (
        "close",
        "drop",
        "freeze",
        "slow",
        "garbage",
        "wrong-version",
        "refuse",
        "no-vest",
        "no-pong",
        "no-entry",
        "flat",
    )

    def __init__(self, port: int, port_v3: int | None = None) -> None:
        self.motors = Motors()
        self.errors: list[str] = []
        self.received = 0
        self.connections = 0
        self._port, self._port_v3 = port, port_v3
        self._fault = ""
        self._playing: dict[str, tuple[int, dict[int, int], float]] = {}
        self._open: set[ServerConnection] = set()
        self._let_in: set[ServerConnection] = set()
        self._servers: list[Server] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> dict[str, Any]:
        """Listen on the loopback interface."""
        # Whoever only looks whether the port is open leaves without a handshake; the library calls that an error.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        address = {"port": await self._serve(self._port, None)}
        if self._port_v3 is not None:
            address["port_v3"] = await self._serve(self._port_v3, server_tls())
        self._tasks.append(asyncio.create_task(self._expire()))
        return address

    async def _serve(self, port: int, tls: ssl.SSLContext | None) -> int:
        server = await serve(
            self._talk,
            "127.0.0.1",
            port,
            ssl=tls,
            process_request=self._greet,
            compression=None,
            ping_interval=None,
            close_timeout=0.2,
        )
        self._servers.append(server)
        return int(next(iter(server.sockets)).getsockname()[1])

    async def fault(self, name: str) -> None:
        """Switch a fault on."""
        self._fault = name
        for connection in list(self._open):
            if name in {"close", "refuse", "wrong-version"}:
                await connection.close(1001)
            elif name == "drop":
                connection.transport.abort()
            elif name == "freeze":
                connection.transport.pause_reading()
            else:
                connection.transport.resume_reading()
                with contextlib.suppress(ConnectionClosed):  # a client that is just leaving receives nothing
                    await self._notify(connection)

    async def _greet(self, connection: ServerConnection, request: Request) -> Response | None:
        while self._fault == "freeze":
            await asyncio.sleep(0.01)
        url = urlsplit(request.path)
        if self._fault == "refuse":
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "not now\n")
        served = "/v3/feedback" if connection.transport.get_extra_info("ssl_object") else "/v2/feedbacks"
        if self._fault == "wrong-version" or url.path != served:
            return connection.respond(HTTPStatus.NOT_FOUND, "no such version\n")
        for key in ("workspace_id", "api_key", "version") if served[2] == "3" else ("app_id", "app_name"):
            if not parse_qs(url.query).get(key):
                self.errors.append(f"query without {key}")
        return None

    async def _talk(self, connection: ServerConnection) -> None:
        self.connections += 1
        self._open.add(connection)
        send_frame = connection.protocol.send_frame

        def send_unless_muted(frame: Any) -> None:
            if not (frame.opcode is Opcode.PONG and self._fault == "no-pong"):
                send_frame(frame)

        connection.protocol.send_frame = send_unless_muted  # type: ignore[method-assign]
        try:
            async for message in connection:
                if self._fault == "slow":
                    connection.transport.pause_reading()
                    await asyncio.sleep(_SLOW_S)
                    if self._fault != "freeze":
                        connection.transport.resume_reading()
                if _speaks_v3(connection):
                    await self._take_v3(connection, message)
                else:
                    self._take(message)
                    await self._notify(connection)
        except ConnectionClosed:
            pass
        finally:
            self._open.discard(connection)
            self._let_in.discard(connection)

    async def _take_v3(self, connection: ServerConnection, message: str | bytes) -> None:
        self.received += 1
        try:
            requested = read_v3(message)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self.errors.append(f"version 3: {type(error).__name__} {error} in {message[:200]!r}")
            return
        now = time.monotonic()
        if requested.kind in {"SdkRequestAuth", "SdkRequestAuthInit"}:
            if self._fault != "no-entry":
                self._let_in.add(connection)
                await self._notify(connection)
        elif connection not in self._let_in:
            if self._fault != "no-entry":
                self.errors.append(f"{requested.kind} of a program that was not let in")
        elif requested.kind == "SdkStopAll":
            self._playing.clear()
        elif requested.kind == "SdkStopByRequestId":
            self._playing.pop(f"request {requested.request}", None)
        elif requested.values:
            lit = {index: value for index, value in enumerate(requested.values) if value}
            self._playing[f"request {requested.request}"] = (0, lit, now + requested.duration_s)
        self._drive(now)

    async def _notify(self, connection: ServerConnection) -> None:
        if self._fault == "garbage":
            for message in _GARBAGE:
                await connection.send(message)
            return
        has_vest = self._fault != "no-vest"
        if _speaks_v3(connection):
            if connection in self._let_in:
                for text in told_v3(has_vest=has_vest, battery=9 if self._fault == "flat" else 98):
                    await connection.send(text)
            return
        status = {"VestFront": self.motors.now[:20], "VestBack": self.motors.now[20:], "Head": [0] * 6}
        await connection.send(
            json.dumps(
                {
                    "RegisteredKeys": [],
                    "ActiveKeys": list(self._playing),
                    "ConnectedDeviceCount": int(has_vest),
                    "ConnectedPositions": ["Vest"] if has_vest else [],
                    "Status": status,
                }
            )
        )

    def _take(self, message: str | bytes) -> None:
        self.received += 1
        try:
            submits = _submits(message)
        except ValueError as error:
            self.errors.append(str(error))
            return
        now = time.monotonic()
        for submit in submits:
            if submit["Type"] == "turnOffAll":
                self._playing.clear()
            elif submit["Type"] == "turnOff":
                self._playing.pop(submit["Key"], None)
            elif (frame := submit["Frame"])["Position"] in _PANELS:
                dots = {dot["Index"]: dot["Intensity"] for dot in frame["DotPoints"]}
                until = now + frame["DurationMillis"] / 1000
                self._playing[submit["Key"]] = (_PANELS[frame["Position"]], dots, until)
        self._drive(now)

    def _drive(self, now: float) -> None:
        self._playing = {key: p for key, p in self._playing.items() if p[2] > now}
        values = [0] * 40
        for base, dots, _ in self._playing.values():
            for index, intensity in dots.items():
                values[base + index] = max(values[base + index], intensity)
        self.motors.set(values)

    async def _expire(self) -> None:
        while True:
            await asyncio.sleep(0.01)
            self._drive(time.monotonic())


def _speaks_v3(connection: ServerConnection) -> bool:
    return connection.request is not None and connection.request.path.startswith("/v3/")


def _submits(message: str | bytes) -> list[dict[str, Any]]:
    """Check a message to the last key and return what it submits."""
    if isinstance(message, bytes):
        raise ValueError("a binary message")  # noqa: TRY004  # bad data, whatever its type
    try:
        request = json.loads(message)
    except ValueError as error:
        raise ValueError(f"not JSON: {error}") from error
    _keys("message", request, needed=set(), allowed={"Register", "Submit"})
    if request.get("Register", []) != []:
        raise ValueError("registers a pattern: not emulated")
    for submit in _list("Submit", request.get("Submit", [])):
        _keys("Submit", submit, needed={"Type"}, allowed={"Type", "Key", "Frame"})
        if submit["Type"] not in {"frame", "turnOff", "turnOffAll"}:
            raise ValueError(f"Type {submit['Type']!r}")
        if submit["Type"] != "turnOffAll" and not (isinstance(submit.get("Key"), str) and submit["Key"]):
            raise ValueError("no Key")
        if submit["Type"] == "frame":
            _check_frame(submit.get("Frame"))
    return list(request.get("Submit", []))


def _check_frame(frame: Any) -> None:
    needed = {"Position", "DurationMillis", "DotPoints", "PathPoints"}
    _keys("Frame", frame, needed=needed, allowed=needed | {"Texture"})
    if frame["Position"] not in _POSITIONS:
        raise ValueError(f"Position {frame['Position']!r}")
    _integer("DurationMillis", frame["DurationMillis"], 20, 100_000)
    if _list("PathPoints", frame["PathPoints"]):
        raise ValueError("PathPoints: not emulated")
    seen = set()
    for dot in _list("DotPoints", frame["DotPoints"]):
        _keys("DotPoint", dot, needed={"Index", "Intensity"}, allowed={"Index", "Intensity"})
        _integer("Index", dot["Index"], 0, 19)
        _integer("Intensity", dot["Intensity"], 0, 100)
        if dot["Index"] in seen:
            raise ValueError(f"Index {dot['Index']} twice")
        seen.add(dot["Index"])


def _keys(subject: str, value: Any, *, needed: set[str], allowed: set[str]) -> None:
    if not isinstance(value, dict) or not needed <= set(value) <= allowed:
        raise ValueError(f"{subject} has the keys {list(value) if isinstance(value, dict) else value!r}")


def _list(subject: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{subject} is {value!r}, not an array")  # noqa: TRY004  # bad data, whatever its type
    return value


def _integer(subject: str, value: Any, least: int, most: int) -> None:
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{subject} {value!r} is not an integer from {least} to {most}")


def main() -> None:
    """Run it until standard input ends."""
    parser = argparse.ArgumentParser(description="An emulated bHaptics Player.")
    parser.add_argument("--port", type=int, default=15881, help="0 for any free one")
    parser.add_argument("--port-v3", type=int, help="of version 3, which is not served without it")
    given = parser.parse_args()
    asyncio.run(vest_process.serve(Player(given.port, given.port_v3)))


if __name__ == "__main__":
    main()
