"""ERR-RTA-PDU: how either end of an AR says that it is over (IEC 61158-6-10, RTA-PDU).

Theory: alarms travel in RTA-PDUs under EtherType 0x8892, addressed by the alarm references that both ends
exchanged at Connect.  The PDU of type ERR carries a PNIOStatus, CF 81 FD and the reason, and ends the AR.
This file knows that one PDU type; the alarm channel itself (DATA, ACK, NACK) is not here.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import rta_status
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW
from pnfarm.protocols.profinet.wire.rpc import PnioStatus
from pnfarm.wire.octets import Reader, Writer

__all__ = ["RtaErrorPdu", "emit_rta_error", "parse_rta_error", "rta_error"]

#: PDUType.Type 4 (ERR), PDUType.Version 1.
_PDU_TYPE_ERR = 0x14
_TYPE_MASK, _TYPE_ERR = 0x0F, 0x04
#: AddFlags: WindowSize 1, TACK 0.
_ADD_FLAGS = 0x01
#: SendSeqNum and AckSeqNum before the first alarm.
_FIRST_SEND, _FIRST_ACK = 0xFFFF, 0xFFFE
_STATUS_SIZE = 4


@dataclass(frozen=True, slots=True)
class RtaErrorPdu:
    """``destination`` and ``source`` are alarm references; ``vendor`` is what may stand behind the status."""

    destination: int
    source: int
    status: PnioStatus
    frame_id: int = ALARM_LOW
    send_sequence: int = _FIRST_SEND
    ack_sequence: int = _FIRST_ACK
    vendor: bytes = b""
    pdu_type: int = _PDU_TYPE_ERR
    add_flags: int = _ADD_FLAGS


def rta_error(destination: int, source: int, code: int) -> RtaErrorPdu:
    """The PDU with the status CF 81 FD ``code`` (:class:`~pnfarm.protocols.profinet.errors.RtaError`)."""
    return RtaErrorPdu(destination, source, rta_status(code))


def parse_rta_error(data: bytes) -> RtaErrorPdu:
    """``data`` starts with the frame id.  Raises ``bad-type`` for every other RTA-PDU.

    What follows the PDU is padding of the Ethernet frame, whatever it holds.
    """
    r = Reader(data)
    frame_id = r.u16()
    if frame_id not in {ALARM_HIGH, ALARM_LOW}:
        raise DecodeError("bad-type", f"frame id 0x{frame_id:04X} is no alarm's")
    destination, source, pdu_type, add_flags, send, ack = r.u16(), r.u16(), r.u8(), r.u8(), r.u16(), r.u16()
    if pdu_type & _TYPE_MASK != _TYPE_ERR:
        raise DecodeError("bad-type", f"RTA-PDU of type 0x{pdu_type:02X} is not ERR")
    body = r.sub(r.u16())
    status = PnioStatus.from_int(body.u32())
    return RtaErrorPdu(destination, source, status, frame_id, send, ack, body.rest(), pdu_type, add_flags)


def emit_rta_error(value: RtaErrorPdu) -> bytes:
    """The octets behind the EtherType."""
    w = Writer().u16(value.frame_id).u16(value.destination).u16(value.source).u8(value.pdu_type)
    w.u8(value.add_flags).u16(value.send_sequence).u16(value.ack_sequence).u16(_STATUS_SIZE + len(value.vendor))
    return w.u32(int(value.status)).bytes(value.vendor).getvalue()
