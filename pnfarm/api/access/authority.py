"""A local authority, and certificates by it: files of a folder.  Needs cryptography (extra ``tls``).

Keys are ECDSA over P-256, whose handshakes cost a farm a fraction of RSA's.  A key can be read by its owner only.
"""

from __future__ import annotations

import re
import socket
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from typing import TYPE_CHECKING, NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives import serialization as form
from cryptography.hazmat.primitives.asymmetric import ec

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.whole_files import write_whole

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["Made", "make_certificate"]

AUTHORITY_DAYS = 3650
#: By which this machine reaches its own farm.
LOOPBACK = ("localhost", "127.0.0.1", "::1")
MOST = 65_536
_NAME = re.compile(r"(?:\*\.)?[A-Za-z0-9_](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?")
#: A clock that is a little behind takes a new certificate, too.
_SLACK = timedelta(minutes=10)


class Made(NamedTuple):
    """What is in the folder; ``is_new``: the authority was made as well."""

    authority: Path
    authority_ends: datetime
    certificate: Path
    key: Path
    names: tuple[str, ...]
    ends: datetime
    is_new: bool


def make_certificate(folder: Path, hosts: Sequence[str], days: int) -> Made:
    """A new certificate for ``hosts``, and an authority where there is none.

    Without ``hosts`` it is for those of the certificate that it replaces, or for this machine's name.  Raises
    :class:`ConfigError` and :class:`EnvironmentError_`.
    """
    ca_file, ca_key_file = folder / "ca.pem", folder / "ca.key"
    certificate_file, key_file = folder / "server.pem", folder / "server.key"
    now = datetime.now(UTC).replace(microsecond=0)
    names = tuple(dict.fromkeys([*_checked(hosts), *([] if hosts else _before(certificate_file)), *LOOPBACK]))
    files: dict[Path, bytes] = {}
    is_new = not ca_file.exists() and not ca_key_file.exists()
    if is_new:
        ca_key = _new_key()
        authority = _authority(ca_key, now)
        files |= {ca_key_file: _key_pem(ca_key), ca_file: _pem(authority)}
    else:
        authority, ca_key = _kept(ca_file, ca_key_file)
    if authority.not_valid_after_utc <= now:
        raise ConfigError(f"the authority {ca_file} has expired: move ca.pem and ca.key away for a new one")
    key = _new_key()
    ends = min(now + timedelta(days=days), authority.not_valid_after_utc)
    certificate = (
        _builder(names[0], authority.subject, key, now, ends)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName([_general(name) for name in names]), critical=False)
        .add_extension(x509.ExtendedKeyUsage([x509.oid.ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(ca_key.public_key()), critical=False)
        .sign(ca_key, hashes.SHA256())
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files |= {key_file: _key_pem(key), certificate_file: _pem(certificate)}
        write_whole({path: octets for path, octets in files.items() if path.suffix == ".key"}, 0o600)
        write_whole({path: octets for path, octets in files.items() if path.suffix == ".pem"}, 0o644)
    except OSError as exc:
        raise EnvironmentError_(
            f"{exc.filename or folder} cannot be written: {(exc.strerror or str(exc)).lower()}"
        ) from exc
    return Made(ca_file, authority.not_valid_after_utc, certificate_file, key_file, names, ends, is_new)


def _checked(hosts: Sequence[str]) -> list[str]:
    found = []
    for host in hosts:
        name = host.strip().removeprefix("[").removesuffix("]")
        try:
            found.append(str(ip_address(name)))
            continue
        except ValueError:
            pass  # a name, then
        if not _NAME.fullmatch(name):
            raise ConfigError(f"--host {host!r} is neither a name nor an address; give one without scheme and port")
        found.append(name.lower())
    return found


def _before(certificate: Path) -> list[str]:
    """The names of the certificate that is replaced, else this machine's."""
    try:
        old = x509.load_pem_x509_certificate(read_regular(certificate, MOST))
        names = old.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, x509.ExtensionNotFound):
        return _checked([socket.gethostname()])
    return [str(name.value) for name in names]


def _kept(ca_file: Path, ca_key_file: Path) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    try:
        authority = x509.load_pem_x509_certificate(read_regular(ca_file, MOST))
        key = form.load_pem_private_key(read_regular(ca_key_file, MOST), None)
    except (OSError, ValueError, TypeError) as exc:
        why = (getattr(exc, "strerror", None) or str(exc)).lower()
        raise ConfigError(f"the authority of {ca_file} and {ca_key_file} cannot be read: {why}") from exc
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != authority.public_key():
        raise ConfigError(f"{ca_key_file} is not the key of the authority {ca_file}")
    return authority, key


def _new_key() -> ec.EllipticCurvePrivateKey:
    return ec.generate_private_key(ec.SECP256R1())


def _key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(form.Encoding.PEM)


def _authority(key: ec.EllipticCurvePrivateKey, now: datetime) -> x509.Certificate:
    # each authority has a name of its own, so that a client with several finds the right one
    name = _named(f"pnfarm authority of {socket.gethostname()[:30]}, {now:%Y-%m-%d %H:%M:%S}")
    return (
        _builder(name, name, key, now, now + timedelta(days=AUTHORITY_DAYS))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .sign(key, hashes.SHA256())
    )


def _named(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, text[:64])])


def _builder(
    subject: str | x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(_named(subject) if isinstance(subject, str) else subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _SLACK)
        .not_valid_after(ends)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _general(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name)
