"""Base mode parameter access as text (PROFIdrive profile): requests and responses, whichever bus carries them."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import Form, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    ATTRIBUTE_TEXT,
    ATTRIBUTE_VALUE,
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_ERROR,
    FORMAT_VISIBLE_STRING,
    FORMAT_WORD,
    REQUEST_CHANGE,
    ParameterAddress,
    ParameterValues,
    format_octets,
    parse_request,
    parse_response,
)
from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["parameter_request", "parameter_response"]

#: Values of one parameter that are shown.
MOST_VALUES = 8
#: Parameters of one request that are shown.
MOST_PARAMETERS = 6
#: Formats of signed numbers: Integer8, Integer16, Integer32, N2 and N4; that of numbers of single precision; those that
#: say only how long a value is (profile 4.1, 5.4).
_SIGNED = frozenset({0x02, 0x03, 0x04, 0x71, 0x72})
_FLOAT = 0x08
_LENGTHS = frozenset({FORMAT_BYTE, FORMAT_WORD, FORMAT_DWORD})


def _parameter(address: ParameterAddress, model: Model | None) -> str:
    known = model.parameters.get(address.pnu) if model is not None else None
    name = f" {known.name}" if known is not None and known.name else ""
    text = f"PNU {address.pnu}{name} sub {address.subindex}"
    if address.attribute == ATTRIBUTE_DESCRIPTION:
        return f"description of {text}"
    if address.attribute == ATTRIBUTE_TEXT:
        return f"text of {text}"
    return f"{text} to {address.subindex + address.elements - 1}" if address.elements > 1 else text


def _value(raw: int, code: int, known: Parameter | None) -> str:
    form = known.form if known is not None and code in _LENGTHS else Form.INTEGER
    if code == _FLOAT or (form is Form.FLOAT and code == FORMAT_DWORD):
        return f"{struct.unpack('>f', raw.to_bytes(4, 'big'))[0]:.7g}"
    bits = 8 * (format_octets(code) or 4)
    signed = code in _SIGNED or (known is not None and code in _LENGTHS and known.signed)
    return str(raw - (1 << bits) if signed and raw >> bits - 1 else raw)


def _values(entry: ParameterValues, address: ParameterAddress | None, model: Model | None) -> str:
    if entry.format == FORMAT_ERROR:
        number = entry.values[0] if entry.values else -1
        try:
            text = ParameterErrorNumber(number).words
        except ValueError:
            text = "unknown"
        return f"error 0x{number & 0xFFFF:02X} ({text})"
    known = None
    if address is not None and address.attribute == ATTRIBUTE_VALUE and model is not None:
        known = model.parameters.get(address.pnu)
    if entry.format == FORMAT_VISIBLE_STRING or (entry.format == FORMAT_BYTE and known is not None and known.text):
        return repr(bytes(entry.values).rstrip(b"\0").decode("latin-1"))
    shown = " ".join(_value(raw, entry.format, known) for raw in entry.values[:MOST_VALUES])
    more = f" and {len(entry.values) - MOST_VALUES} more" if len(entry.values) > MOST_VALUES else ""
    return (shown + more) or "no value"


def _joined(texts: list[str]) -> str:
    more = f", and {len(texts) - MOST_PARAMETERS} more" if len(texts) > MOST_PARAMETERS else ""
    return ", ".join(texts[:MOST_PARAMETERS]) + more


def parameter_request(data: bytes, model: Model | None) -> str:
    """The text of a written parameter request."""
    try:
        request = parse_request(data)
    except DecodeError as exc:
        return f"not a parameter request ({exc})"
    if request.fault is not None:
        return f"parameter request with a fault: {request.fault.detail}"
    addresses = [_parameter(address, model) for address in request.addresses]
    if request.request_id == REQUEST_CHANGE:
        changes = [
            f"{name} = {_values(entry, address, model)}"
            for name, address, entry in zip(addresses, request.addresses, request.values, strict=True)
        ]
        return f"change parameter {_joined(changes)}"
    return f"request parameter {_joined(addresses)}"


def parameter_response(data: bytes, request: bytes | None, model: Model | None) -> str:
    """The text of a read response; ``request`` is the one written before, which names the parameters."""
    try:
        response = parse_response(data)
    except DecodeError as exc:
        return f"not a parameter response ({exc})"
    addresses: Sequence[ParameterAddress | None] = ()
    if request is not None:
        try:
            asked = parse_request(request)
        except DecodeError:
            asked = None
        if asked is not None and asked.reference == response.reference:
            addresses = asked.addresses
    names = [f"{_parameter(address, model)} " for address in addresses if address is not None]
    changed = response.response_id == REQUEST_CHANGE
    if not response.entries:
        return f"parameter {_joined([name.strip() for name in names])} changed" if names else "parameters changed"
    if len(names) != len(response.entries):
        names, addresses = [""] * len(response.entries), [None] * len(response.entries)
    sign = "" if any(entry.format == FORMAT_ERROR for entry in response.entries) else "= "
    texts = [
        f"{name}{sign}{_values(entry, address, model)}"
        for name, address, entry in zip(names, addresses, response.entries, strict=True)
    ]
    return f"parameter {'changed ' if changed else ''}{_joined(texts)}"
