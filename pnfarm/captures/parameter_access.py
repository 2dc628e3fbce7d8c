"""Base mode parameter access as text (PROFIdrive profile): requests and responses, whichever bus carries them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    ATTRIBUTE_TEXT,
    FORMAT_ERROR,
    REQUEST_CHANGE,
    ParameterAddress,
    ParameterValues,
    parse_request,
    parse_response,
)
from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["parameter_request", "parameter_response"]

#: Values of one parameter that are shown.
MOST_VALUES = 8
#: Parameters of one request that are shown.
MOST_PARAMETERS = 6


def _parameter(address: ParameterAddress, model: Model | None) -> str:
    known = model.parameters.get(address.pnu) if model is not None else None
    name = f" {known.name}" if known is not None and known.name else ""
    text = f"PNU {address.pnu}{name} sub {address.subindex}"
    if address.attribute == ATTRIBUTE_DESCRIPTION:
        return f"description of {text}"
    if address.attribute == ATTRIBUTE_TEXT:
        return f"text of {text}"
    return f"{text} to {address.subindex + address.elements - 1}" if address.elements > 1 else text


def _values(entry: ParameterValues) -> str:
    if entry.format == FORMAT_ERROR:
        number = entry.values[0] if entry.values else -1
        try:
            text = ParameterErrorNumber(number).words
        except ValueError:
            text = "unknown"
        return f"error 0x{number & 0xFFFF:02X} ({text})"
    shown = " ".join(map(str, entry.values[:MOST_VALUES]))
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
        changes = [f"{a} = {_values(v)}" for a, v in zip(addresses, request.values, strict=True)]
        return f"change parameter {_joined(changes)}"
    return f"request parameter {_joined(addresses)}"


def parameter_response(data: bytes, request: bytes | None, model: Model | None) -> str:
    """The text of a read response; ``request`` is the one written before, which names the parameters."""
    try:
        response = parse_response(data)
    except DecodeError as exc:
        return f"not a parameter response ({exc})"
    names: list[str] = []
    if request is not None:
        try:
            asked = parse_request(request)
        except DecodeError:
            asked = None
        if asked is not None and asked.reference == response.reference:
            names = [f"{_parameter(address, model)} " for address in asked.addresses]
    changed = response.response_id == REQUEST_CHANGE
    if not response.entries:
        return f"parameter {_joined([name.strip() for name in names])} changed" if names else "parameters changed"
    if len(names) != len(response.entries):
        names = [""] * len(response.entries)
    sign = "" if any(entry.format == FORMAT_ERROR for entry in response.entries) else "= "
    texts = [f"{name}{sign}{_values(entry)}" for name, entry in zip(names, response.entries, strict=True)]
    return f"parameter {'changed ' if changed else ''}{_joined(texts)}"
