"""Records of DP-V1 in a capture: requests, answers, connections of class 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.captures.parameter_access import parameter_request, parameter_response
from pnfarm.protocols.profibus.wire.dpv1 import (
    NEGATIVE,
    Abort,
    AbortReason,
    ErrorCode1,
    Function,
    InitiateAnswer,
    ResourceManager,
    parse_access,
    parse_initiate,
    parse_refusal,
)
from pnfarm.wire.code import words_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from enum import IntEnum

    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profibus.wire.dpv1 import Access

__all__ = ["Records"]

#: Data unit index of base mode parameter access.
_PARAMETERS = 47
_NAMES = {
    Function.READ: "Read", Function.WRITE: "Write", Function.DATA_TRANSPORT: "Data_Transport", Function.IDLE: "Idle",
    Function.INITIATE: "Initiate", Function.ABORT: "Abort", Function.RESOURCE_MANAGER: "Resource_Manager",
}  # fmt: skip


def _word(numbers: type[IntEnum], value: int) -> str:
    words = words_of(numbers, value, "")
    return f"0x{value:02X} ({words})" if words else f"0x{value:02X}"


@dataclass(slots=True)
class Records:
    """One way to records: MSAC1, or one connection of class 2.  ``written``: the last request for parameters."""

    written: bytes | None = None

    def request(self, data: bytes, model: Model | None) -> Iterator[Description]:
        """What a master asks for; a poll without data gives no line."""
        if not data:
            return
        name = _name(data[0])
        match data[0]:
            case Function.READ | Function.WRITE | Function.DATA_TRANSPORT:
                access = parse_access(data)
                text = _record(access)
                counted = {Function.READ.value: "reads", Function.WRITE.value: "writes"}.get(access.function)
                if access.index == _PARAMETERS and access.function == Function.WRITE:
                    self.written = access.data
                    text = _record(access, parameter_request(access.data, model))
                details = {"slot": access.slot, "index": access.index, "length": access.length}
                yield Description(f"{name}.req", text, details, {counted: ""} if counted else {})
            case Function.INITIATE:
                asked = parse_initiate(data)
                yield Description(f"{name}.req", f"send time-out {asked.send_timeout_ns / 1e6:g} ms")
            case Function.ABORT:
                yield self._abort(data)
            case Function.IDLE:
                return
            case _:
                yield Description("unknown PDU", data.hex(" "))

    def answer(self, data: bytes, model: Model | None) -> Iterator[Description]:
        """What the slave answers; nothing for an acknowledgement."""
        if not data:
            return
        name = _name(data[0] & ~NEGATIVE)
        if data[0] & NEGATIVE:
            refusal = parse_refusal(data)
            reason = _word(ErrorCode1, refusal.code1)
            text = f"{reason}, code 2 0x{refusal.code2:02X}"
            details = {"error_code_1": refusal.code1, "error_code_2": refusal.code2}
            yield Description(f"{name}.res(-)", text, details, {"record errors": f"{name}: {reason}"})
            return
        match data[0]:
            case Function.READ | Function.WRITE | Function.DATA_TRANSPORT:
                access = parse_access(data)
                text = _record(access)
                if access.index == _PARAMETERS and access.function == Function.READ:
                    text = _record(access, parameter_response(access.data, self.written, model))
                yield Description(f"{name}.res", text, {"slot": access.slot, "index": access.index})
            case Function.RESOURCE_MANAGER:
                found = ResourceManager.parse(data)
                yield Description(
                    f"{name}.res", f"access point {found.sap}, send time-out {found.send_timeout_ns / 1e6:g} ms"
                )
            case Function.INITIATE:
                longest = InitiateAnswer.parse(data).longest
                yield Description(f"{name}.res", f"up to {longest} octets of data", counts={"connects": ""})
            case Function.ABORT:
                yield self._abort(data)
            case Function.IDLE:
                return
            case _:
                yield Description("unknown PDU", data.hex(" "))

    @staticmethod
    def _abort(data: bytes) -> Description:
        found = Abort.parse(data)
        reason = _word(AbortReason, found.reason)
        return Description("Abort", reason, {"reason": found.reason}, {"aborts": reason})


def _record(access: Access, data: str = "") -> str:
    """``data``: in words, else in hexadecimal."""
    text = f"slot {access.slot} index {access.index}, {access.length} octets"
    shown = data or access.data.hex(" ")
    return f"{text}: {shown}" if shown else text


def _name(number: int) -> str:
    try:
        return _NAMES[Function(number)]
    except (KeyError, ValueError):
        return f"function 0x{number:02X}"
