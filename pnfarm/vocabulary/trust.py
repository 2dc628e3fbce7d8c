"""What a client of a farm trusts: the system's authorities, or those in a file that the user names (PEM)."""

from __future__ import annotations

import os
import ssl
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["CA_VARIABLE", "client_context", "why_untrusted"]

#: Environment variable that names the file of the authorities; used where no option does.
CA_VARIABLE = "PNFARM_TLS_CA"
#: Octets of a file of certificates; the system's own has a quarter of that.
MOST = 1_000_000
#: What a check found, by OpenSSL's number (X509_STORE_CTX_get_error).
_FOUND = {
    9: "its certificate is not valid yet; compare the clocks of both machines",
    10: "its certificate has expired",
    62: "its certificate is for another name; use a name or address that it was made for",
    64: "its certificate is for another address; use a name or address that it was made for",
}


def client_context(ca: str | os.PathLike[str] | None = None) -> ssl.SSLContext:
    """How a client checks servers: by the authorities in the file ``ca``, or in the one that PNFARM_TLS_CA names.

    Without either by those of the system.  Raises :class:`ConfigError`.
    """
    named = ca or os.environ.get(CA_VARIABLE) or None
    context = ssl.create_default_context() if named is None else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if named is None:
        return context
    path = Path(named)
    origin = f"the authority's file {path}" + ("" if ca else f" ({CA_VARIABLE})")
    try:
        text = read_regular(path, MOST).decode("ascii")
        context.load_verify_locations(cadata=text)
    except OSError as exc:
        # an SSLError is one, without a reason of the system
        why = "it holds no certificate in PEM" if isinstance(exc, ssl.SSLError) else (exc.strerror or str(exc)).lower()
        raise ConfigError(f"{origin} cannot be used: {why}") from exc
    except ValueError as exc:
        raise ConfigError(f"{origin} cannot be used: it holds no certificate in PEM") from exc
    return context


def why_untrusted(failure: BaseException) -> str | None:
    """Why a connection failed, as a clause about the server, if TLS was the reason."""
    for exc in _causes(failure):
        if isinstance(exc, ssl.SSLCertVerificationError):
            return _unverified(exc)
        if isinstance(exc, ssl.SSLError):
            plain = {"WRONG_VERSION_NUMBER", "HTTP_REQUEST", "RECORD_LAYER_FAILURE"}
            return "it does not speak TLS: give its address as http://" if exc.reason in plain else f"TLS: {exc.reason}"
    return None


def _causes(failure: BaseException) -> Iterator[BaseException]:
    exc: BaseException | None = failure
    seen = 0
    # a client's library wraps the error several times
    while exc is not None and seen < 16:
        yield exc
        exc, seen = exc.__cause__ or exc.__context__, seen + 1


def _unverified(exc: ssl.SSLCertVerificationError) -> str:
    return _FOUND.get(
        exc.verify_code,
        f"its certificate is from an unknown authority ({exc.verify_message}): name its file with --tls-ca",
    )
