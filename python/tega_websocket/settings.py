"""Define the table ``[websocket]``."""

from __future__ import annotations

import ipaddress
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Final

import msgspec

from tega.config import SessionConfig
from tega.config.guests import TableContext
from tega.errors import ConfigError

SHORTEST_TOKEN: Final = 16
"""Characters of a token at least."""


class WebSocketTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Server of a run's records as JSON over WebSocket; needs the extra ``websocket``.

    Attributes:
        host: Address to serve; one that other machines reach needs ``token_file``.
        port: TCP port; 0 for any free one.
        token_file: File with the token of the address, 16 characters or more; none means a new token for each run.
        origins: Web pages that may connect besides those of this address, such as ``http://localhost:5173``.
        topics: Patterns of the topics that are sent, such as ``/tactile/*``.
        pictures_hz: Fingertip pictures a second of each finger, as JPEG in base64; 0 for none.
        hand: Whether a client may ask for level or closure, in place of ``[emg]``.
        arm: Whether a client may lead the arm, in place of ``arm.tracker``.
        ttl_ms: Greatest age of a command that is obeyed.
        buffer: Messages that wait for a slow client; older ones are dropped and counted.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, msgspec.Meta(ge=0, le=65_535)] = 8766
    token_file: Path | None = None
    origins: tuple[str, ...] = ()
    topics: tuple[str, ...] = ("/*",)
    pictures_hz: Annotated[float, msgspec.Meta(ge=0, le=60)] = 0.0
    hand: bool = False
    arm: bool = False
    ttl_ms: Annotated[float, msgspec.Meta(ge=20, le=2000)] = 200.0
    buffer: Annotated[int, msgspec.Meta(ge=16, le=65_536)] = 512

    @property
    def on_this_machine(self) -> bool:
        """Whether the address is reached from this machine only."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def sends(self, topic: str) -> bool:
        """Return whether records of a topic are sent."""
        return any(fnmatchcase(topic, pattern) for pattern in self.topics)


def check_table(table: WebSocketTable, context: TableContext) -> WebSocketTable:
    """Check the table against the other settings, and make its path absolute.

    Two inputs that claim hand or arm, or an address that leaves this machine without a token of its own,
    raise :class:`ConfigError`.
    """
    config = context.config
    if not table.on_this_machine and table.token_file is None:
        raise ConfigError(
            f"websocket.host = {table.host!r} is reached from other machines, and websocket.token_file is not set",
            "set websocket.token_file, or use 127.0.0.1",
        )
    check_claims("websocket", config, hand=table.hand, arm=table.arm)
    if table.token_file is None:
        return table
    return msgspec.structs.replace(table, token_file=context.base / table.token_file)


def check_claims(name: str, config: SessionConfig, *, hand: bool, arm: bool) -> None:
    """Check the claims of a table to lead hand or arm against the other settings.

    Two inputs that claim hand or arm, no arm, or a session not in real time raise :class:`ConfigError`.
    """
    claims = (
        ("hand", hand and config.emg is not None, "[emg]"),
        ("arm", arm and config.arm is not None and config.arm.tracker is not None, "arm.tracker"),
    )
    for subject, twice, other in claims:
        if twice:
            raise ConfigError(
                f"{name}.{subject} and {other} both lead the {subject}",
                f"take out {other} or {name}.{subject}",
            )
    if arm and config.arm is None:
        raise ConfigError(f"{name}.arm is set, but there is no [arm]", f"set [arm], or take out {name}.arm")
    if (hand or arm) and config.session.pace == "fast":
        raise ConfigError(
            f"{name}.hand and {name}.arm need real time, and session.pace = 'fast'",
            "set session.pace = 'real'",
        )


def read_token(path: Path) -> str:
    """Return the token of a file; one too short, or not of printable ASCII, raises :class:`ConfigError`."""
    try:
        with path.open("rb") as file:
            text = file.read(4096).decode("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"websocket.token_file: {path.name} cannot be read: {error}",
            "write a token of letters and digits into it, such as the output of: openssl rand -hex 16",
        ) from error
    if len(text) < SHORTEST_TOKEN or not text.replace("-", "").replace("_", "").isalnum():
        raise ConfigError(
            f"websocket.token_file: the token of {path.name} has {len(text)} characters; "
            f"{SHORTEST_TOKEN} letters, digits, - or _ are needed at least",
            "make one with: openssl rand -hex 16",
        )
    return text
