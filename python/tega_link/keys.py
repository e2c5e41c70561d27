"""Make a private certificate authority, and one certificate for each station."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID

from tega.errors import ConfigError
from tega.runtime.files.foreign_file import read_foreign
from tega_link.link import KEY_FILES

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,62}")  # as in a certificate
_PEM = serialization.Encoding.PEM
_AUTHORITY_DAYS = 3650
_WARN_DAYS = 30
_RESTORE = "restore it from a copy; with a new authority every station needs new keys"
_EARLY = timedelta(hours=24)  # the machines' wall clocks need not agree better
_Authority: TypeAlias = tuple[ec.EllipticCurvePrivateKey, x509.Certificate]


class StationKeys(NamedTuple):
    """One station's folder.

    ``expires`` is until when its certificate holds, UTC; ``made`` whether it was made just now.
    """

    name: str
    folder: Path
    expires: datetime
    made: bool


def make_keys(
    folder: Path, *, operators: Sequence[str], robots: Sequence[str], days: int = 365
) -> list[StationKeys]:
    """Create missing keys: the authority, and a folder for each station.

    ``authority`` in ``folder`` stays where it is; each station's folder goes to its machine. ``days`` is how
    long a station's certificate holds. A name that cannot be used or stands twice, or a missing file of a folder,
    raises :class:`ConfigError`.
    """
    names = [*operators, *robots]
    for name in names:
        if not _NAME.fullmatch(name) or name == "authority":
            raise ConfigError(
                f"{name!r} cannot be a station's name",
                "use letters, digits, dots and dashes, such as alice or panda-2",
            )
    if len(set(names)) < len(names):
        raise ConfigError("two stations have the same name", "give each its own")
    now = datetime.now(UTC)
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    authority = _authority(folder / "authority", now)
    return [_station(folder / name, name, authority, now, days) for name in names]


def expiry(folder: Path) -> datetime:
    """Return until when a station's certificate holds, UTC."""
    try:
        return x509.load_pem_x509_certificate(_read(folder / KEY_FILES[1])).not_valid_after_utc
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{folder.name}: its certificate cannot be read: {error}", "make it with: tega-teleop net keys"
        ) from error


def check_expiry(folder: Path, *, now: datetime | None = None) -> str:
    """Return a warning that a certificate ends soon, ``""`` if not; one that has ended is an error."""
    until = expiry(folder)
    left = until - (datetime.now(UTC) if now is None else now)
    again = f"delete {folder.name} where it was made, and make a new one with: tega-teleop net keys"
    if left <= timedelta(0):
        raise ConfigError(f"net.keys: the certificate in {folder.name} ended on {until:%Y-%m-%d}", again)
    if left > timedelta(days=_WARN_DAYS):
        return ""
    return f"warning: the certificate in {folder.name} ends on {until:%Y-%m-%d}; {again}"


def _read(path: Path) -> bytes:
    return read_foreign(path, most_mib=1, error=ConfigError)


def _authority(folder: Path, now: datetime) -> _Authority:
    certificate_file, key_file = folder / "ca.pem", folder / "ca.key"
    if key_file.exists():
        try:
            key: Any = serialization.load_pem_private_key(_read(key_file), None)
            there = x509.load_pem_x509_certificate(_read(certificate_file))
            # The certificate's parts are read when they are asked for.
            _, belongs = there.subject, key.public_key() == there.public_key()
        except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
            raise ConfigError(f"{folder.name}: its keys cannot be read: {error}", _RESTORE) from error
        if not belongs or not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ConfigError(
                f"{folder.name}: {key_file.name} is not the key of {certificate_file.name}", _RESTORE
            )
        return key, there
    made = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "TEGA private authority")])
    certificate = (
        _builder(name, name, made, now, _AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .sign(made, hashes.SHA256())
    )
    folder.mkdir(mode=0o700, exist_ok=True)
    _write_key(key_file, made)
    _write(certificate_file, certificate.public_bytes(_PEM))
    return made, certificate


def _station(folder: Path, name: str, authority: _Authority, now: datetime, days: int) -> StationKeys:
    files = [folder / file for file in KEY_FILES]
    there = [file.exists() for file in files]
    if all(there):
        return StationKeys(name, folder, expiry(folder), made=False)
    if any(there):
        raise ConfigError(f"{folder.name} holds some of the keys only", "delete that folder, then try again")
    signing, issuer = authority
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    usages = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    certificate = (
        _builder(subject, issuer.subject, key, now, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), critical=False
        )
        .sign(signing, hashes.SHA256())
    )
    folder.mkdir(mode=0o700, exist_ok=True)
    _write_key(folder / KEY_FILES[2], key)
    _write(folder / KEY_FILES[1], certificate.public_bytes(_PEM))
    _write(folder / KEY_FILES[0], issuer.public_bytes(_PEM))
    return StationKeys(name, folder, certificate.not_valid_after_utc, made=True)


def _builder(subject: Any, issuer: Any, key: ec.EllipticCurvePrivateKey, now: datetime, days: int) -> Any:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLY)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(*, signs: bool) -> Any:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def _write_key(file: Path, key: ec.EllipticCurvePrivateKey) -> None:
    plain = serialization.NoEncryption()
    _write(file, key.private_bytes(_PEM, serialization.PrivateFormat.PKCS8, plain))


def _write(file: Path, content: bytes) -> None:
    """Write a file that only its owner may read, from its first byte on."""
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as out:
        out.write(content)
