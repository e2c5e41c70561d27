"""Query a Franka robot's control interface for its version, and find the matching software.

This module has only the robot's handshake. The handshake returns the server's version without moving anything. It
does not need libfranka, so it also works if the library is missing or has the wrong version.
"""

from __future__ import annotations

import re
import socket
import struct
import sys
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from tega.errors import DeviceUnavailableError, WrongDeviceError

PORT: Final = 1337
_PACKAGE: Final = "franky-control"
_HEADER: Final = struct.Struct("<III")
_CONNECT: Final = 0
_STATUS: Final = {0: "accepted", 1: "of another version"}
# By its length: robots pack a byte of status and the version; franky-sim gives each two bytes, and four more.
_REPLIES: Final = {3: struct.Struct("<BH"), 8: struct.Struct("<HH4x")}
_MOST_BYTES: Final = 64
_ANSWER_S: Final = 2.0

# Highest libfranka below which a robot server's number holds, and that number; the makers' table of compatibility.
_SERVERS: Final = (
    ((0, 8), 3),
    ((0, 9), 4),
    ((0, 10), 5),
    ((0, 13, 3), 6),
    ((0, 14, 1), 7),
    ((0, 15), 8),
    ((0, 18), 9),
)
_NEWEST: Final = 10
_PANDA_SERVERS: Final = range(3, 6)


Finding: TypeAlias = tuple[bool, str, str]
"""Whether a check passed, a description, and the fix if it failed."""


class Library(NamedTuple):
    """The libfranka of the installed franky-control, such as ``0.21.2``, and the robot server's version for it.

    Where they are unknown, ``libfranka`` is ``""`` and ``server`` is ``None``.
    """

    version: str
    libfranka: str
    server: int | None


def fitting_server(libfranka: str) -> int | None:
    """Return the number of the robot server that a libfranka connects to; ``None`` if it is no version.

    Example:
        >>> fitting_server("0.9.2"), fitting_server("0.21.2"), fitting_server("?")
        (5, 10, None)
    """
    if not re.fullmatch(r"\d+(\.\d+)+", libfranka):
        return None
    numbers = tuple(map(int, libfranka.split(".")))
    return next((server for below, server in _SERVERS if numbers < below), _NEWEST)


def installed_library() -> Library | None:
    """Return the libfranka that franky-control brings, by its files' names; ``None`` if it is not installed."""
    try:
        own = version(_PACKAGE)
    except PackageNotFoundError:
        return None
    for file in files(_PACKAGE) or ():
        if found := re.search(r"libfranka.*\.so\.(\d+\.\d+\.\d+)$", Path(file).name):
            return Library(own, found[1], fitting_server(found[1]))
    return Library(own, "", None)


def server_version(host: str) -> int:
    """Ask a robot for the version of its server, and hang up; ``WrongDeviceError`` if it is not a robot.

    The robot takes one client at a time: do not ask while another steers it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states:
        states.bind(("", 0))
        try:
            with socket.create_connection((host, PORT), timeout=_ANSWER_S) as link:
                # Version 0 fits no robot: it answers with its own and sends nothing more. A simulator may go on.
                body = struct.pack("<HH", 0, states.getsockname()[1])
                link.sendall(_HEADER.pack(_CONNECT, 1, _HEADER.size + len(body)) + body)
                data = b""
                while len(data) < _size(data):
                    more = link.recv(_MOST_BYTES)
                    if not more:
                        raise ConnectionResetError(f"it hung up after {len(data)} bytes")
                    data += more
        except TimeoutError as error:
            raise DeviceUnavailableError(
                f"the robot at {host} does not answer on port {PORT}",
                "is FCI activated in Desk, are the brakes open, and is no other program connected?",
            ) from error
        except OSError as error:
            raise DeviceUnavailableError(
                f"the robot at {host} cannot be reached: {error.strerror or error}",
                "is the cable in the control box's LAN port, and this its address? Activate FCI in Desk",
            ) from error
    command, number, size = _HEADER.unpack_from(data)
    reply = _REPLIES.get(size - _HEADER.size)
    status, server = (-1, 0) if reply is None else reply.unpack_from(data, _HEADER.size)
    if (command, number) != (_CONNECT, 1) or status not in _STATUS:
        raise WrongDeviceError(f"what answers at {host}:{PORT} is no Franka robot", "check the address")
    return int(server)


def _size(data: bytes) -> int:
    """Return the expected length of an answer in bytes; for anything else, the available length."""
    if len(data) < _HEADER.size:
        return _HEADER.size
    size: int = _HEADER.unpack_from(data)[2]
    return size if size - _HEADER.size in _REPLIES else len(data)


def the_fix(server: int, library: Library | None) -> str:
    """Return the software to install for a robot's server version; ``""`` if the installed one fits."""
    if library is not None and library.server == server:
        return ""
    if server == _NEWEST:
        return "pip install 'franky-control>=2,<3'"
    return (
        f"this is {'a Panda' if server in _PANDA_SERVERS else 'an FR3'} with robot server {server}: install "
        "franky-control's wheel for it from the index that franky's own documentation names, path "
        f"by-robot-server-version/{server}/"
    )


def machine_findings() -> list[Finding]:
    """Check this machine for libfranka's requirements."""
    if sys.platform != "linux":
        return [(False, f"{sys.platform} instead of Linux", "libfranka steers a robot from Linux only")]
    import resource

    realtime = Path("/sys/kernel/realtime")
    is_rt = realtime.is_file() and realtime.read_text().strip() == "1"
    priority, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    unlimited = priority == resource.RLIM_INFINITY
    governors = {
        path.read_text().strip()
        for path in Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
    }
    return [
        (
            is_rt,
            f"kernel {'with' if is_rt else 'without'} PREEMPT_RT",
            "boot a real-time kernel; realtime = 'ignore' goes without, for a simulator",
        ),
        (
            unlimited or priority >= 99,
            f"highest real-time priority {'unlimited' if unlimited else priority}",
            "give your user rtprio 99 in /etc/security/limits.conf and log in again",
        ),
        (
            governors <= {"performance"},
            f"processor's governor {', '.join(sorted(governors)) or 'not shown'}",
            "cpupower frequency-set -g performance",
        ),
    ]


def preflight(host: str, *, robot: str, realtime: bool) -> list[Finding]:
    """Ask a robot for its version, and check whether library and machine are fit to lead it; nothing moves.

    ``robot`` is ``panda`` or ``fr3``, as in the settings. ``realtime``: the machine has to be fit for real time
    too. Raises ``WrongDeviceError`` if the device is not a robot.
    """
    server, library = server_version(host), installed_library()
    fix, kind = the_fix(server, library), "Panda" if server in _PANDA_SERVERS else "FR3"
    has = f"no {_PACKAGE}" if library is None else f"{_PACKAGE} {library.version}"
    if library is not None:
        has += f", libfranka {library.libfranka or '?'} for robot server {library.server or '?'}"
    findings = [(True, f"robot server {server} ({kind}) at {host}", ""), (not fix, has, fix)]
    if robot != kind.lower():
        text = f"the settings say {robot}, and the robot is {'an' if kind == 'FR3' else 'a'} {kind}"
        findings.append(
            (False, text, f"set arm.options.robot = {kind.lower()!r}: the joints have other limits")
        )
    return findings + (machine_findings() if realtime else [])
