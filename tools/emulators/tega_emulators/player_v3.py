"""Version 3 of the emulated Player's websocket: what it takes, and what it says of itself and its devices.

Written from what clients that the vendor published send, and from what open servers and clients of this version read.
Types that a vest has no use for are taken without a look; a ping would make the real devices vibrate, and counts as
an error.
"""

from __future__ import annotations

import datetime as dt
import json
import ssl
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["VEST_NAME", "AskedV3", "read_v3", "server_tls", "told_v3"]

VEST_NAME = "TactSuitX40"
_ADDRESS = "C0FFEE004001"
_KNOWN = {
    "SdkRequestAuth",
    "SdkRequestAuthInit",
    "SdkPlayDotMode",
    "SdkStopAll",
    "SdkStopByRequestId",
    "SdkPlay",
    "SdkRequestReInit",
}


class AskedV3(NamedTuple):
    """What a client asks for.

    ``kind`` is the message's type, ``request`` its number, 0 where there is none; ``values`` are forty motor
    values, or none.
    """

    kind: str
    request: int = 0
    values: tuple[int, ...] = ()
    duration_s: float = 0.0


def read_v3(message: str | bytes) -> AskedV3:
    """Check a message of a client; one that a vest's client should not send raises :class:`ValueError`."""
    envelope = json.loads(message)
    if not isinstance(envelope, dict):
        raise ValueError("no object")  # noqa: TRY004  # bad data, whatever its type
    kind = envelope.get("Type", envelope.get("type"))
    if kind not in _KNOWN:
        raise ValueError(f"Type {kind!r}")
    inner = envelope.get("Message", envelope.get("message"))
    content: Any = json.loads(inner) if isinstance(inner, str) and inner else inner
    if kind in {"SdkRequestAuth", "SdkRequestAuthInit"}:
        _check_introduction(content["authentication"] if kind == "SdkRequestAuthInit" else content)
    if kind == "SdkStopByRequestId":
        return AskedV3(kind, int(content["requestId"] if isinstance(content, dict) else content))
    if kind != "SdkPlayDotMode":
        return AskedV3(kind)
    values = content["motorValues"]
    if content["position"] != 0:
        return AskedV3("other device")
    if len(values) not in {32, 40} or any(type(v) is not int or not 0 <= v <= 100 for v in values):
        raise ValueError(f"motorValues {values!r}")
    if not 20 <= content["durationMillis"] <= 100_000:
        raise ValueError(f"durationMillis {content['durationMillis']!r}")
    if len(values) == 32:
        values = [*values[:16], 0, 0, 0, 0, *values[16:], 0, 0, 0, 0]
    return AskedV3(kind, int(content["requestId"]), tuple(values), content["durationMillis"] / 1000)


def _check_introduction(text: Any) -> None:
    # The vendor's clients write these names with a capital or without.
    text = {name.lower(): value for name, value in text.items()}
    for name in ("sdkApiKey", "applicationId", "cipher", "nonceHashValue", "applicationIdHashValue"):
        if not isinstance(text.get(name.lower()), str):
            raise ValueError(f"introduction without {name}")  # noqa: TRY004  # bad data, whatever its type


def told_v3(*, has_vest: bool, battery: int) -> list[str]:
    """Return what the Player reports of itself to a program that it has let in."""
    vest = {
        "position": 0,
        "deviceName": VEST_NAME,
        "address": _ADDRESS,
        "connected": has_vest,
        "paired": True,
        "battery": battery if has_vest else -1,
        "audioJackIn": False,
        "vsm": 20,
    }
    arm = {**vest, "position": 1, "deviceName": "Tactosy2 (L)", "address": "C0FFEE004002", "battery": 26}
    return [
        json.dumps({"Type": kind, "Message": json.dumps(text)})
        for kind, text in (
            ("ServerReady", None),
            ("ServerEventNameList", []),
            ("ServerEventList", []),
            ("ServerDevices", [arm, vest]),
        )
    ]


def server_tls() -> ssl.SSLContext:
    """Make a key, sign its certificate with itself, as the Player does, and return what a server needs of both."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = dt.datetime.now(dt.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=1))
        .not_valid_after(now + dt.timedelta(days=30))
        .sign(key, hashes.SHA256())
    )
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    with tempfile.TemporaryDirectory() as folder:
        chain = Path(folder, "both.pem")
        plain = serialization.NoEncryption()
        pem = serialization.Encoding.PEM
        chain.write_bytes(
            key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain) + certificate.public_bytes(pem)
        )
        context.load_cert_chain(chain)
    return context
