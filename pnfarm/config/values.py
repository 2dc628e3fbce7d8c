"""Simple values of the farm file: station patterns, addresses, ports, records' octets.

Each ``read_*`` takes the value from the file and returns it parsed, or raises a :class:`Problem` that
names what is allowed; the ``Annotated`` types below carry them into the models and into the JSON Schema.
"""

from __future__ import annotations

import re
from ipaddress import AddressValueError, IPv4Address, IPv4Interface, NetmaskValueError, ip_address
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, PlainValidator, WithJsonSchema

from pnfarm.vocabulary.durations import DURATION_PATTERN, format_duration, read_duration
from pnfarm.vocabulary.globs import GLOBS_SCHEMA, read_globs
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown
from pnfarm.wire.mac import format_mac, parse_mac

__all__ = [
    "AUTO",
    "DURATION_SCHEMA",
    "OFF",
    "Cidr",
    "Duration",
    "FarmName",
    "Gateway",
    "Globs",
    "Interface",
    "Listen",
    "MacSetting",
    "NamePattern",
    "OctetString",
    "Scalar",
    "between",
    "expand_name",
    "file_key",
    "is_loopback",
    "numbered",
    "secret_key",
]

#: ``mac: auto``.
AUTO = "auto"
#: Switches a section off; ``false`` means the same, for editors that read YAML 1.1.
OFF: Literal["off"] = "off"

#: IFNAMSIZ of Linux less the closing NUL.
MAX_INTERFACE_NAME = 15

_FARM_NAME = re.compile(r"[a-z0-9]([a-z0-9-]{0,38}[a-z0-9])?")
_COUNTER = re.compile(r"\{n(?::0([1-9]))?\}")
_INTERFACE = re.compile(r"[^\s/:\x00-\x1f]+")
_LISTEN = re.compile(r"(?:\[([0-9a-fA-F:.]+)\]|([A-Za-z0-9._-]+)):([0-9]{1,5})")
_HOST_LABEL = re.compile(r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?")
_CIDR = re.compile(r"([0-9.]{7,15})/([0-9]{1,2})")


def _text(value: Any, allowed: str) -> str:
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}, not a word", allowed)
    return value


def read_farm_name(value: Any) -> str:
    allowed = "a-z, 0-9 and - inside, at most 40 characters"
    text = _text(value, allowed)
    if not _FARM_NAME.fullmatch(text):
        raise Problem(f"{shown(text)} is not a farm name", allowed)
    return text


def read_name_pattern(value: Any) -> str:
    allowed = "a station name such as press, axis-{n} or axis-{n:02}"
    if isinstance(value, dict):
        allowed += ', in flow style with quotes around it: "axis-{n}"'
    text = _text(value, allowed)
    if not text or len(text) > 240:
        raise Problem("a station name has 1 to 240 characters", allowed)
    rest = _COUNTER.sub("0", text)
    if "{" in rest or "}" in rest:
        raise Problem(f"{shown(text)} has braces other than {{n}} and {{n:02}}", allowed)
    return text


def numbered(pattern: str) -> bool:
    """Whether the pattern counts."""
    return _COUNTER.search(pattern) is not None


def expand_name(pattern: str, n: int) -> str:
    """``axis-{n:02}`` and 3: ``axis-03``; a number longer than its width keeps all its digits."""
    return _COUNTER.sub(lambda match: f"{n:0{match[1] or 1}}", pattern)


def read_cidr(value: Any) -> IPv4Interface:
    allowed = "an IPv4 address with its prefix length, such as 10.77.0.11/24"
    text = _text(value, allowed)
    if not _CIDR.fullmatch(text):
        raise Problem(f"{shown(text)} is not an address with a prefix length", allowed)
    try:
        interface = IPv4Interface(text)
    except (AddressValueError, NetmaskValueError) as error:
        raise Problem(f"{shown(text)} is not an address with a prefix length", allowed) from error
    if not 1 <= interface.network.prefixlen <= 30:
        raise Problem(f"/{interface.network.prefixlen} leaves no room for a drive and its controller", "/1 to /30")
    if (what := _unusable(interface.ip)) is not None:
        raise Problem(f"{interface.ip} is {what}", allowed)
    return interface


def read_gateway(value: Any) -> IPv4Address:
    allowed = "an IPv4 address such as 10.77.0.1"
    text = _text(value, allowed)
    try:
        address = IPv4Address(text)
    except AddressValueError as error:
        raise Problem(f"{shown(text)} is not an address", allowed) from error
    if (what := _unusable(address)) is not None:
        raise Problem(f"{address} is {what}", allowed)
    return address


def _unusable(address: IPv4Address) -> str | None:
    if address.is_multicast:
        return "a multicast address"
    if address.is_loopback:
        return "a loopback address"
    if int(address) >> 24 in {0, *range(240, 256)}:
        return "no address of a station"
    return None


def read_mac(value: Any) -> bytes | str:
    allowed = "auto, or a unicast address such as 02:00:00:00:00:01"
    text = _text(value, allowed)
    if text == AUTO:
        return AUTO
    try:
        mac = parse_mac(text)
    except ValueError as error:
        raise Problem(f"{shown(text)} is not a MAC address", allowed) from error
    if mac[0] & 1:
        raise Problem(f"{format_mac(mac)} is a multicast address", allowed)
    if not any(mac):
        raise Problem("the MAC address of all zeros belongs to no station", allowed)
    return mac


def read_interface(value: Any) -> str:
    allowed = "a network interface such as eth1"
    text = _text(value, allowed)
    if len(text.encode()) > MAX_INTERFACE_NAME:
        raise Problem(f"{shown(text)} is longer than an interface name can be", f"{MAX_INTERFACE_NAME} octets")
    if not _INTERFACE.fullmatch(text) or text in {".", ".."}:
        raise Problem(f"{shown(text)} is not an interface name", allowed)
    return text


def read_listen(value: Any) -> tuple[str, int]:
    allowed = "HOST:PORT such as 127.0.0.1:8702"
    text = _text(value, allowed)
    match = _LISTEN.fullmatch(text)
    if match is None:
        raise Problem(f"{shown(text)} is not HOST:PORT", allowed)
    host, port = match[1] or match[2], int(match[3])
    if port > 65535:
        raise Problem(f"{port} is not a TCP port", "0 (any free one) to 65535")
    if match[2] and not _is_host(host):
        raise Problem(f"{shown(host)} is not a host", allowed)
    return host, port


def _is_host(host: str) -> bool:
    if re.fullmatch(r"[0-9.]+", host):
        try:
            IPv4Address(host)
        except AddressValueError:
            return False
        return True
    return len(host) <= 253 and all(_HOST_LABEL.fullmatch(label) for label in host.split("."))


def read_octets(value: Any) -> bytes:
    allowed = "octets in hexadecimal, such as '00 01 0a'; in quotes when only digits"
    text = _text(value, allowed)
    try:
        return bytes.fromhex(text)
    except ValueError as error:
        raise Problem(f"{shown(text)} is not hexadecimal", allowed) from error


def read_scalar(value: Any) -> int | float | str | bool:
    if isinstance(value, float) and not abs(value) < float("inf"):
        raise Problem(f"is {value}", "a finite number")
    if not isinstance(value, (int, float, str)):
        raise Problem(f"is {shown(value)}", "a number or a word")
    return value


def is_loopback(host: str) -> bool:
    """Whether a host name or address is loopback."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def secret_key(description: str) -> Any:
    """A token or a password: no message repeats it."""
    return Field(default=None, repr=False, min_length=8, max_length=512, description=description)


def file_key(description: str) -> Any:
    """The name of a file."""
    return Field(default=None, min_length=1, max_length=4096, description=description)


def _schema(**schema: Any) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", **schema})


def between(least: int, most: int, allowed: str, *, zero: bool = False) -> AfterValidator:
    """A check of durations, ns; ``zero``: 0 is allowed besides."""

    def check(value: int) -> int:
        if not (zero and value == 0) and not least <= value <= most:
            raise Problem(f"is {format_duration(value)}", allowed)
        return value

    return AfterValidator(check)


DURATION_SCHEMA = _schema(pattern=DURATION_PATTERN, examples=["500ms", "2s", "31.25us"])

FarmName = Annotated[str, PlainValidator(read_farm_name), _schema(pattern=f"^{_FARM_NAME.pattern}$", maxLength=40)]
NamePattern = Annotated[
    str,
    PlainValidator(read_name_pattern),
    _schema(minLength=1, maxLength=240, examples=["press", "axis-{n}", "axis-{n:02}"]),
]
Cidr = Annotated[
    IPv4Interface,
    PlainValidator(read_cidr),
    _schema(pattern=r"^[0-9]{1,3}(\.[0-9]{1,3}){3}/[0-9]{1,2}$", examples=["10.77.0.11/24"]),
]
Gateway = Annotated[IPv4Address, PlainValidator(read_gateway), _schema(format="ipv4", examples=["10.77.0.1"])]
MacSetting = Annotated[
    bytes | str,
    PlainValidator(read_mac),
    _schema(pattern=r"^(auto|[0-9a-fA-F]{2}([:-][0-9a-fA-F]{2}){5})$", examples=["auto", "02:00:00:00:00:01"]),
]
Duration = Annotated[int, PlainValidator(read_duration), DURATION_SCHEMA]
Globs = Annotated[list[str], PlainValidator(read_globs), WithJsonSchema(GLOBS_SCHEMA)]
Interface = Annotated[str, PlainValidator(read_interface), _schema(minLength=1, maxLength=15, examples=["eth1"])]
Listen = Annotated[tuple[str, int], PlainValidator(read_listen), _schema(examples=["127.0.0.1:8702"])]
OctetString = Annotated[bytes, PlainValidator(read_octets), _schema(pattern="^([0-9a-fA-F]{2} *)*$")]
Scalar = Annotated[
    int | float | str | bool,
    PlainValidator(read_scalar),
    WithJsonSchema({"type": ["number", "string", "boolean"]}),
]
