"""encapsulation-error: answers on TCP have a wrong encapsulation."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

from pnfarm.buses.ethernetip.faults.frames import CipFramesEffect
from pnfarm.buses.ethernetip.faults.messages import MESSAGES
from pnfarm.errors import DecodeError
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.gate.socket_gate import DATAGRAM
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec, words_of
from pnfarm.protocols.enip.wire.encapsulation import EncapsulationStatus, emit_encapsulation, parse_encapsulation

__all__ = ["KIND"]

_WHAT = {"status": 0, "session": 1, "length": 2, "context": 3, "garbage": 4}
_STATUS = {word: number for word, number in words_of(EncapsulationStatus).items() if number}


class EncapsulationError(CipFramesEffect):
    """Whole messages that the drive sends on its streams."""

    acyclic = MESSAGES - {DATAGRAM}

    def rule(self, *args: Any, **fields: Any) -> GateRule:
        return GateRule(*args, of_messages=True, instead=self._spoilt, **fields)

    def _spoilt(self, message: bytes) -> bytes | None:
        try:
            pdu = parse_encapsulation(message)
        except DecodeError:
            # another fault has spoilt it already
            return message
        match self.values["what"]:
            case "status":
                return emit_encapsulation(replace(pdu, status=self.values["status"], data=b""))
            case "session":
                return emit_encapsulation(replace(pdu, session=(pdu.session + 1) & 0xFFFFFFFF))
            case "context":
                return emit_encapsulation(replace(pdu, context=bytes(octet ^ 0xFF for octet in pdu.context)))
            case "length":
                announced: int = max(0, min(0xFFFF, len(pdu.data) + self.values["by"]))
                return b"".join((message[:2], announced.to_bytes(2, "little"), message[4:]))
            case _:
                return hashlib.shake_128(message).digest(len(message))


KIND = InjectionKind(
    "encapsulation-error",
    "connection",
    "Answers on TCP have a wrong encapsulation header: a status with which the command was refused, another session "
    "handle, sender context or length than right; or they are garbage of the right size.",
    "an answer that is changed",
    EncapsulationError,
    {
        "what": ParamSpec("word", "What is wrong.", default="status", words=_WHAT),
        "status": ParamSpec(
            "whole number",
            "With `what: status`.",
            default="invalid-session-handle",
            words=_STATUS,
            low=1,
            high=0xFFFFFFFF,
        ),
        "by": ParamSpec(
            "whole number",
            "With `what: length`: octets that the header announces beyond those that follow, or below 0 fewer.",
            default=16,
            low=-65535,
            high=65535,
        ),
    },
    directions=("out",),
    takes=EACH,
    place=96,
    wire="Encapsulation messages of the drive with one wrong field, or octets that are no message.",
    reports="The message fails; after a wrong length or garbage nothing that follows can be read, and the scanner "
    "closes the TCP connection. Logix: the MSG instruction ends with an error; without a connection the "
    "module stays faulted. CODESYS: the request ends with an error (all assumed). Cyclic data continue.",
)
