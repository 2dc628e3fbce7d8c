"""The cyclic connection that an EDS file describes (CIP volume 1, chapter 7-3, section Connection Manager).

Fields of an entry ``ConnectionN``: trigger and transport, connection parameters, then RPI, size and format from
originator to target, the same back, size and format of two parts of configuration, name, help, path.  A size may be a
number, the default of a ``ParamN``, or empty: then the ``AssemN`` that the format names has it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.wire.epath import ElectronicKey

if TYPE_CHECKING:
    from pnfarm.protocols.enip.eds import Eds, EdsEntry

__all__ = ["EdsConnection", "connection_of", "device_of"]

# Fields of a connection, from 0.
_TRANSPORT, _PARAMETERS = 0, 1
_OUTPUT_SIZE, _OUTPUT_FORMAT, _INPUT_SIZE, _INPUT_FORMAT = 3, 4, 6, 7
_CONFIGURATIONS = ((8, 9), (10, 11))
_NAME, _PATH = 12, 14
#: Field of the size in AssemN, octets, and of the default in ParamN.
_ASSEMBLY_SIZE, _DEFAULT = 2, 11

# Bits of trigger and transport: class 1; cyclic; application types.
_CLASS_1, _CYCLIC = 1 << 1, 1 << 16
_KINDS = ((1 << 26, "exclusive-owner"), (1 << 25, "input-only"), (1 << 24, "listen-only"))
# Connection parameters: real-time formats of both directions, types of the target's.
_OUTPUT_MODE, _INPUT_MODE = 8, 12
_WITH_HEADER = 4
_MULTICAST, _POINT_TO_POINT = 1 << 21, 1 << 22

_CONNECTION = re.compile(r"connection[0-9]+", re.IGNORECASE)
#: A frame has room for so many octets of data.
LONGEST = 1400


@dataclass(frozen=True, slots=True)
class EdsConnection:
    """``path`` is the application path alone, without a key; sizes are of data alone, octets."""

    keyword: str
    name: str
    kind: str
    path: bytes
    output_octets: int
    input_octets: int
    output_header: bool
    input_header: bool
    multicast: bool
    point_to_point: bool
    configuration_octets: int


def connection_of(eds: Eds, wanted: str | None = None) -> EdsConnection:
    """The connection of this keyword or name, or the first one with an exclusive owner, or the first one at all.

    Raises :class:`ConfigError` where there is none, or where it is said in a way that cannot be followed.
    """
    section = eds.section("Connection Manager")
    entries = [entry for entry in section.entries if _CONNECTION.fullmatch(entry.keyword)] if section else []
    usable = [entry for entry in entries if (entry.number(_TRANSPORT) or 0) & _CLASS_1]
    if not usable:
        raise ConfigError("the section Connection Manager has no connection of class 1")
    if wanted is None:
        chosen = next((entry for entry in usable if _kind(entry) == "exclusive-owner"), usable[0])
    else:
        names = {entry.keyword.casefold(): entry for entry in usable}
        names |= {entry.text(_NAME).strip().casefold(): entry for entry in reversed(usable)}
        found = names.get(wanted.casefold())
        if found is None:
            known = ", ".join(f"{entry.keyword} ({entry.text(_NAME).strip()})" for entry in usable)
            raise ConfigError(f"there is no connection {wanted!r} of class 1; there are {known}")
        chosen = found
    return _read(eds, chosen)


def device_of(eds: Eds) -> tuple[ElectronicKey, str]:
    """Identity and name of the product (section Device); a number that is not there is 0."""
    section = eds.section("Device")
    if section is None:
        raise ConfigError("there is no section Device")

    def number(keyword: str) -> int:
        entry = section.entry(keyword)
        return (entry.number(0) or 0) if entry is not None else 0

    key = ElectronicKey(number("VendCode"), number("ProdType"), number("ProdCode"), number("MajRev"), number("MinRev"))
    name = section.entry("ProdName")
    return key, "" if name is None else name.text(0).strip()


def _kind(entry: EdsEntry) -> str:
    transport = entry.number(_TRANSPORT) or 0
    return next((kind for bit, kind in _KINDS if transport & bit), "exclusive-owner")


def _read(eds: Eds, entry: EdsEntry) -> EdsConnection:
    transport, parameters = entry.number(_TRANSPORT) or 0, entry.number(_PARAMETERS)
    if parameters is None:
        raise ConfigError(f"{entry.keyword}: its connection parameters are not a number")
    if not transport & _CYCLIC:
        raise ConfigError(f"{entry.keyword}: it has no cyclic production")
    return EdsConnection(
        keyword=entry.keyword,
        name=entry.text(_NAME).strip(),
        kind=_kind(entry),
        path=_path(entry),
        output_octets=_size(eds, entry, _OUTPUT_SIZE, _OUTPUT_FORMAT),
        input_octets=_size(eds, entry, _INPUT_SIZE, _INPUT_FORMAT),
        output_header=parameters >> _OUTPUT_MODE & 7 == _WITH_HEADER,
        input_header=parameters >> _INPUT_MODE & 7 == _WITH_HEADER,
        multicast=bool(parameters & _MULTICAST),
        point_to_point=bool(parameters & _POINT_TO_POINT),
        configuration_octets=sum(_size(eds, entry, *places) for places in _CONFIGURATIONS),
    )


def _path(entry: EdsEntry) -> bytes:
    text = entry.text(_PATH).strip()
    if not re.fullmatch(r"(?:[0-9A-Fa-f]{2}\s*)+", text):
        raise ConfigError(f"{entry.keyword}: its path {text!r} is not octets alone")
    path = bytes.fromhex(text)
    if len(path) % 2:
        raise ConfigError(f"{entry.keyword}: its path {text!r} is not whole words")
    return path


def _size(eds: Eds, entry: EdsEntry, size: int, form: int) -> int:
    """Octets of one direction."""
    text, described = entry.text(size).strip(), entry.text(form).strip()
    if text:
        octets = _number(eds, entry, text)
    elif described:
        octets = _assembly(eds, entry, described)
    else:
        octets = 0
    if not 0 <= octets <= LONGEST:
        raise ConfigError(f"{entry.keyword}: {octets} octets of data do not fit into a frame")
    return octets


def _number(eds: Eds, entry: EdsEntry, text: str) -> int:
    """A number, or the default of a parameter."""
    if re.fullmatch(r"param[0-9]+", text, re.IGNORECASE):
        section = eds.section("Params")
        parameter = section.entry(text) if section is not None else None
        value = parameter.number(_DEFAULT) if parameter is not None else None
    else:
        value = _whole(text)
    if value is None:
        raise ConfigError(f"{entry.keyword}: the size {text!r} is not a number, and no default of a parameter")
    return value


def _whole(text: str) -> int | None:
    try:
        return int(text, 0)
    except ValueError:
        return None


def _assembly(eds: Eds, entry: EdsEntry, name: str) -> int:
    section = eds.section("Assembly")
    found = section.entry(name) if section is not None else None
    if found is None:
        raise ConfigError(f"{entry.keyword}: there is no {name}")
    text = found.text(_ASSEMBLY_SIZE).strip()
    if not text:
        raise ConfigError(f"{entry.keyword}: {name} has no size")
    return _number(eds, found, text)
