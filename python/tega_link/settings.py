"""Define the table ``[net]`` of a station's settings."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import msgspec

from tega.config import SessionConfig
from tega.config.guests import TableContext
from tega.config.sections import TrackerConfig
from tega.errors import ConfigError

KEYS_COMMAND = "tega-teleop net keys keys --operator NAME --robot NAME"
_DEFAULT_PORT = 7447
_Ms = Annotated[float, msgspec.Meta(ge=10, le=10_000)]
_Name = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,62}$")]


class NetSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """This station's end of the link to the other one; needs the extra ``net``.

    Attributes:
        station: Which one this is: ``operator`` or ``robot``.
        name: What this station is called; with keys, the name in its certificate.
        robot: Operator only: name of the robot to lead.
        operators: Robot only: operators who may lead it; without any and without keys, any operator on this machine
            may.
        connect: Operator only: address of the robot, such as ``tls/192.168.1.20:7447``.
        listen: Robot only: address on which it waits for operators, such as ``tls/192.168.1.20:7447``.
        keys: This station's folder, as ``tega-teleop net keys`` makes it; needed for any address but this machine's.
        rate_hz: Operator only: commands a second.
        ttl_ms: A command that may be older than this is not obeyed, touch likewise not felt, and without a command for
            so long the robot holds. Has to be above the way there and back.
        lost_ms: Operator only: time without a message from the robot after which it stops sending and reports that.
        lease_ms: After so long without a sign the other station counts as gone.
        wait_s: Operator only: time to look for the robot at the start.
        images_hz: Robot only: frames a second of each fingertip that are sent for display; 0 for none.
        jpeg_quality: JPEG quality of these frames.
        tracker: Operator only: the tracker of the forearm; none means ``input.motion``, if there is one.
    """

    station: Literal["operator", "robot"]
    name: _Name | None = None
    robot: _Name = "robot"
    operators: tuple[_Name, ...] = ()
    connect: str | None = None
    listen: str | None = None
    keys: Path | None = None
    rate_hz: Annotated[float, msgspec.Meta(ge=30, le=200)] = 100.0
    ttl_ms: _Ms = 100.0
    lost_ms: _Ms = 500.0
    lease_ms: _Ms = 500.0
    wait_s: Annotated[float, msgspec.Meta(gt=0, le=3600)] = 10.0
    images_hz: Annotated[float, msgspec.Meta(ge=0, le=60)] = 10.0
    jpeg_quality: Annotated[int, msgspec.Meta(ge=1, le=100)] = 80
    tracker: TrackerConfig | None = None

    @property
    def own_name(self) -> str:
        """This station's name."""
        return self.name or self.station

    @property
    def robot_name(self) -> str:
        """The robot's name, which all keys begin with."""
        return self.robot if self.station == "operator" else self.own_name


class Endpoint(NamedTuple):
    """A place in the network: ``scheme`` is ``tcp`` or ``tls``, ``host`` a name or address."""

    scheme: str
    host: str
    port: int

    @classmethod
    def read(cls, key: str, text: str) -> Endpoint:
        """Read an endpoint, such as ``tls/192.168.1.20:7447``; any other text raises :class:`ConfigError`."""
        scheme, slash, rest = text.partition("/")
        host, colon, port = rest.rpartition(":")
        if not colon:
            host, port = rest, str(_DEFAULT_PORT)
        host = host.strip("[]")
        if scheme not in {"tcp", "tls"} or not slash or not host or not port.isdecimal():
            raise ConfigError(
                f"{key}: {text!r} is no endpoint",
                "write tls/ADDRESS:7447, or tcp/127.0.0.1:7447 on one machine",
            )
        if not 0 <= int(port) <= 65_535:
            raise ConfigError(f"{key}: port {port} is not from 0 to 65535", "7447 is usual")
        return cls(scheme, host, int(port))

    @property
    def on_this_machine(self) -> bool:
        """Whether the address can be reached from this machine only."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def __str__(self) -> str:
        """Return it as it is written."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}/{host}:{self.port}"


def checked_net(net: NetSection) -> Endpoint:
    """Check that the fields fit together; return where this station listens or connects to.

    A link that would leave this machine without keys raises :class:`ConfigError`, too.
    """
    ours, others = ("connect", "listen") if net.station == "operator" else ("listen", "connect")
    text = getattr(net, ours)
    if text is None:
        raise ConfigError(
            f"net.{ours} is not set",
            f'set net.{ours} = "tls/ADDRESS:7447", or "tcp/127.0.0.1:7447" on one machine',
        )
    if getattr(net, others) is not None:
        raise ConfigError(f"net.{others} is set, but the {net.station}'s station has none", f"use net.{ours}")
    endpoint = Endpoint.read(f"net.{ours}", text)
    if net.keys is None and (endpoint.scheme == "tls" or not endpoint.on_this_machine):
        raise ConfigError(
            f"net.{ours} = {text!r} leaves this machine, and net.keys is not set: anybody could steer the robot"
            if not endpoint.on_this_machine
            else f"net.{ours} = {text!r} asks for keys, and net.keys is not set",
            f"make keys with: {KEYS_COMMAND}; then set net.keys on both stations",
        )
    if net.keys is not None and endpoint.scheme != "tls":
        raise ConfigError(
            f"net.keys is set, but net.{ours} = {text!r} does not use them",
            f"write tls/ instead of {endpoint.scheme}/",
        )
    if net.keys is not None and net.station == "robot" and not net.operators:
        raise ConfigError(
            "net.operators is empty, so no operator may lead the robot",
            'set it, such as net.operators = ["alice"]',
        )
    return endpoint


def check_table(net: NetSection, context: TableContext) -> NetSection:
    """Check the fields together, and return the table with the tracker's options typed; see :func:`checked_net`."""
    checked_net(net)
    if net.tracker is None:
        return net
    tracker = context.with_options(net.tracker, "tracker", "net.tracker")
    return msgspec.structs.replace(net, tracker=tracker)


def net_of(config: SessionConfig) -> NetSection | None:
    """Return the link's table of a session's settings; ``None`` where there is none."""
    found: NetSection | None = config.guests.get("net")
    return found
