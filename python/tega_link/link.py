"""Open one Zenoh session with the settings that were measured for it, and send and receive messages.

Messages are sent by a separate thread, so that steering never waits for a network. Received messages are passed to a
function in one of Zenoh's threads, which must not send or wait.
"""

from __future__ import annotations

import contextlib
import json
import queue
import threading
import time
from collections.abc import Callable
from enum import Enum
from typing import Any

from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.lifecycle import Opened, require
from tega_link.settings import NetSection, checked_net

KEY_FILES = ("ca.pem", "station.pem", "station.key")
"""A station's folder of keys: the authority's certificate, its own, and its own private key."""

_LEAVE_S = 2.0
# Measured: with two, the default, messages are lost on one machine whenever a thread waits for more than a millisecond.
_QUEUE = 16
_RETRY_MS = (100, 500)
# Messages that may wait for the sender's thread; of more the oldest are left out, since what is old is of no use.
_MOST_WAITING = 1000
_REPORTED_S = 1.0


class Channel(Enum):
    """Priority of a message, and whether it goes at once instead of in batches. Nothing ever blocks the sender."""

    COMMAND = ("REAL_TIME", True)  # and the questions for the clock
    FEATURES = ("INTERACTIVE_HIGH", True)
    STATE = ("INTERACTIVE_HIGH", False)
    EVENT = ("DATA_HIGH", False)
    RECORD = ("DATA", False)
    IMAGE = ("DATA_LOW", False)


def root_key(robot: str) -> str:
    """Return the part that all keys of a robot begin with."""
    return f"tega/v1/{robot}"


class Link(Opened):
    """Zenoh session of this station; ``root`` is what all its keys begin with.

    ``n_unsent`` counts messages that were not sent: the transport refused them, or too many waited.
    """

    def __init__(self, net: NetSection) -> None:
        self._net = net
        self.root = root_key(net.robot_name)
        self._zenoh: Any = None
        self._session: Any = None
        self._kept: list[Any] = []
        self._publishers: dict[str, Any] = {}
        self._queue: queue.SimpleQueue[tuple[Any, bytes] | None] = queue.SimpleQueue()
        self._sender: threading.Thread | None = None
        self.n_unsent = 0
        self._refused, self._refused_s = "", 0.0

    def open(self) -> None:
        """Open the session; the other station need not be there.

        :class:`ConfigError`: settings do not fit, or keys are missing. :class:`DeviceUnavailableError`: the
        address cannot be used.
        """
        if self._session is not None:
            return
        settings = zenoh_settings(self._net)
        self._zenoh = zenoh = require("zenoh", driver="tega_link", extra="net")
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            where = self._net.listen or self._net.connect
            raise DeviceUnavailableError(
                f"net: {where} cannot be used: {_first_line(error)}",
                "another program may listen there, or the address is not this machine's",
            ) from error
        self._sender = threading.Thread(target=self._send, name="tega-net-send", daemon=True)
        self._sender.start()

    def close(self) -> None:
        """Close the session; one that is left open keeps the program from ending."""
        session, self._session = self._session, None
        if session is None:
            return
        self._queue.put(None)
        if self._sender is not None:
            self._sender.join(_LEAVE_S)
        for one in reversed(self._kept):
            one.undeclare()
        self._kept.clear()
        self._publishers.clear()
        session.close()

    def sends(self, key: str, channel: Channel) -> Callable[[bytes], None]:
        """Return the function that sends a message under a key; it never waits."""
        zenoh = self._zenoh
        priority, express = channel.value
        publisher = self._session.declare_publisher(
            f"{self.root}/{key}",
            priority=getattr(zenoh.Priority, priority),
            congestion_control=zenoh.CongestionControl.DROP,
            express=express,
        )
        self._kept.append(publisher)

        def send(message: bytes) -> None:
            if self._session is None:
                return
            if self._queue.qsize() >= _MOST_WAITING:
                with contextlib.suppress(queue.Empty):
                    self._queue.get_nowait()
                self._not_sent("the sender does not keep up")
            self._queue.put((publisher, message))

        return send

    @property
    def problem(self) -> str:
        """Why messages were not sent within the last second, and how many so far; ``""`` while all are."""
        if not self._refused or time.monotonic() - self._refused_s > _REPORTED_S:
            return ""
        return f"link: {self.n_unsent} messages were not sent: {self._refused}"

    def _not_sent(self, why: str) -> None:
        self.n_unsent += 1
        self._refused, self._refused_s = why, time.monotonic()

    def _send(self) -> None:
        while (item := self._queue.get()) is not None:
            publisher, message = item
            try:
                self._put(publisher, message)
            except Exception as error:  # one refusal is no reason to send nothing any more
                if self._session is None:
                    return
                self._not_sent(_first_line(error))

    @staticmethod
    def _put(publisher: Any, message: bytes) -> None:
        publisher.put(message)

    def receives(self, key: str, received: Callable[[str, bytes], None]) -> None:
        """Call a function with every message under a key expression: the key after the root, and the message."""
        cut = len(self.root) + 1

        def callback(sample: Any) -> None:
            received(str(sample.key_expr)[cut:], sample.payload.to_bytes())

        self._kept.append(self._session.declare_subscriber(f"{self.root}/{key}", callback))

    def answers(self, key: str, answer: Callable[[str, bytes], bytes]) -> None:
        """Answer questions under a key expression."""
        cut = len(self.root) + 1

        def callback(query: Any) -> None:
            with query:
                requested = b"" if query.payload is None else query.payload.to_bytes()
                query.reply(query.key_expr, answer(str(query.key_expr)[cut:], requested))

        self._kept.append(self._session.declare_queryable(f"{self.root}/{key}", callback))

    def asks(self, key: str, message: bytes, answered: Callable[[bytes], None], *, timeout_s: float) -> None:
        """Ask once; the answer, if there is one, comes later."""

        def callback(reply: Any) -> None:
            if reply.ok is not None:
                answered(reply.ok.payload.to_bytes())

        self._session.get(f"{self.root}/{key}", callback, payload=message, timeout=timeout_s)

    def lives(self, key: str) -> Callable[[], None]:
        """Give a sign of life under a key for as long as the session lasts; return what ends it."""
        token = self._session.liveliness().declare_token(f"{self.root}/{key}")

        def end() -> None:
            if self._session is not None:
                token.undeclare()

        return end

    def watches(self, key: str, seen: Callable[[str, bool], None]) -> None:
        """Call a function when a liveliness token under a key expression begins or ends, existing ones first."""
        cut = len(self.root) + 1
        put = self._zenoh.SampleKind.PUT

        def callback(sample: Any) -> None:
            seen(str(sample.key_expr)[cut:], sample.kind == put)

        watching = self._session.liveliness().declare_subscriber(f"{self.root}/{key}", callback, history=True)
        self._kept.append(watching)


def zenoh_settings(net: NetSection) -> dict[str, Any]:
    """Return Zenoh's settings for a station, by their path.

    A link that would leave this machine without keys, or a missing file of them, raises :class:`ConfigError`.
    """
    endpoint = str(checked_net(net))
    first_ms, most_ms = _RETRY_MS
    operator = net.station == "operator"
    settings: dict[str, Any] = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": [] if operator else [endpoint],
        "listen/exit_on_failure": True,
        "listen/timeout_ms": 0,
        "connect/endpoints": [endpoint] if operator else [],
        "connect/exit_on_failure": False,
        "connect/timeout_ms": -1,
        "connect/retry": {"period_init_ms": first_ms, "period_max_ms": most_ms, "period_increase_factor": 2},
        "transport/link/tx/lease": round(net.lease_ms),
        "transport/link/tx/keep_alive": 4,
        "transport/link/tx/queue/size/real_time": _QUEUE,
        "transport/link/tx/queue/size/data": _QUEUE,
        "transport/shared_memory/enabled": False,
    }
    if net.keys is not None:
        authority, certificate, private = (net.keys / name for name in KEY_FILES)
        for file in (authority, certificate, private):
            if not file.is_file():
                raise ConfigError(
                    f"net.keys: {net.keys.name} has no {file.name}",
                    "make a station's folder with: tega-teleop net keys keys --operator NAME --robot NAME",
                )
        settings["transport/link/tls"] = {
            "root_ca_certificate": str(authority),
            "enable_mtls": True,
            "listen_certificate": str(certificate),
            "listen_private_key": str(private),
            "connect_certificate": str(certificate),
            "connect_private_key": str(private),
            # Addresses change; who the other station is says the name in its certificate, by the rules below.
            "verify_name_on_connect": False,
            "close_link_on_expiration": True,
        }
        settings["access_control"] = _access(net)
    return settings


_ALL = [
    *("put", "delete", "declare_subscriber", "query", "reply", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
]


def _access(net: NetSection) -> dict[str, Any]:
    """Return who may send and receive which keys, by the names in certificates; all else is refused."""
    root = root_key(net.robot_name)

    def rule(name: str, messages: list[str], flow: str, keys: list[str]) -> dict[str, Any]:
        return {
            "id": name,
            "messages": messages,
            "flows": [flow],
            "permission": "allow",
            "key_exprs": [f"{root}/{key}" for key in keys],
        }

    rules, subjects, policies = [], [], []
    others = [net.robot] if net.station == "operator" else list(net.operators)
    for name in others:
        ours = [rule(f"to {name}", _ALL, "egress", ["**"])]
        if net.station == "operator":
            ours.append(rule(f"from {name}", _ALL, "ingress", ["**"]))
        else:
            received = ["state", "event", "clock/*", "tactile/**"]
            ours += [
                rule(f"{name} hears", ["declare_subscriber"], "ingress", received),
                rule(f"{name} says", ["put"], "ingress", [f"cmd/{name}/**"]),
                rule(f"{name} asks", ["query"], "ingress", [f"join/{name}"]),
                rule(f"{name} lives", ["liveliness_token"], "ingress", [f"operator/{name}/*"]),
            ]
        rules += ours
        subjects.append({"id": name, "cert_common_names": [name]})
        policies.append({"rules": [r["id"] for r in ours], "subjects": [name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]
