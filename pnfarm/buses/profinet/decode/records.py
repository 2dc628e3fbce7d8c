"""Records as text: names of indexes, parameter requests and responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameter import ParameterErrorNumber
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
    from pnfarm.drives.model import Model

__all__ = ["BASE_MODE_INDEXES", "index_text", "parameter_request", "parameter_response"]

#: Base mode parameter access: the profile's two record numbers, and 47 of DP-V1 and of several drives.
BASE_MODE_INDEXES = frozenset({0x002F, 0xB02E, 0xB02F})
#: IEC 61158-6-10, coding of the field Index.
_INDEXES = {
    0x8000: "expected identification of the subslot", 0x8001: "real identification of the subslot",
    0x800A: "channel diagnosis of the subslot", 0x800C: "diagnosis of the subslot",
    0x8020: "PDIRSubframeData", 0x8028: "RecordInputData", 0x8029: "RecordOutputData", 0x802A: "PDPortDataReal",
    0x802B: "PDPortDataCheck", 0x802C: "PDIRData", 0x802D: "PDSyncData", 0x802F: "PDPortDataAdjust",
    0x8051: "PDInterfaceMrpDataCheck", 0x8052: "PDInterfaceMrpDataAdjust", 0x8053: "PDPortMrpDataAdjust",
    0x8070: "PDNCDataCheck", 0x8071: "PDInterfaceAdjust", 0x8072: "PDPortStatistic", 0x8080: "PDInterfaceDataReal",
    0x8090: "PDInterfaceFSUDataAdjust", 0x80B0: "CombinedObjectContainer",
    0xAFF0: "I&M0", 0xAFF1: "I&M1", 0xAFF2: "I&M2", 0xAFF3: "I&M3", 0xAFF4: "I&M4",
    0xC000: "expected identification of the slot", 0xC001: "real identification of the slot",
    0xE000: "expected identification of the AR", 0xE001: "real identification of the AR", 0xE002: "ModuleDiffBlock",
    0xE00C: "diagnosis of the AR", 0xE040: "multiple write", 0xE050: "ARFSUDataAdjust",
    0xB050: "external PLL (Siemens)", 0xB060: "trace unit (Siemens)",
    0xF000: "real identification of the API", 0xF80C: "diagnosis of the device", 0xF820: "ARData", 0xF821: "APIData",
    0xF830: "LogBookData", 0xF831: "PDevData", 0xF840: "I&M0FilterData", 0xF841: "PDRealData", 0xF842: "PDExpectedData",
}  # fmt: skip
#: Values of one parameter that are shown.
MOST_VALUES = 8
#: Parameters of one request that are shown.
MOST_PARAMETERS = 6


def index_text(index: int) -> str:
    """``0xAFF0 (I&M0)``."""
    if index in BASE_MODE_INDEXES:
        return f"0x{index:04X} (parameter access)"
    name = _INDEXES.get(index)
    return f"0x{index:04X} ({name})" if name else f"0x{index:04X}"


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
