"""PTCP, the clock protocol between neighbours: sync, announce, follow up and the measurement of a cable's delay
(IEC 61158-6-10, PTCP-PDU).

A drive of conformance class B takes no part in it; switches and controllers send it to its port.  Every PDU has a
head of 20 octets after its frame id, then TLVs up to the one of type End.
"""

from __future__ import annotations

from dataclasses import dataclass
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

__all__ = ["PTCP_NAMES", "PtcpPdu", "PtcpTlv", "TlvType", "emit_ptcp", "parse_ptcp"]

#: What a frame id means.
PTCP_NAMES: dict[int, str] = {
    0x0020: "RTSync (clock, with follow up)",
    0x0021: "RTSync (time, with follow up)",
    0x0080: "RTSync (clock)",
    0x0081: "RTSync (time)",
    0xFF00: "Announce (clock)",
    0xFF01: "Announce (time)",
    0xFF20: "FollowUp (clock)",
    0xFF21: "FollowUp (time)",
    0xFF40: "DelayReq",
    0xFF41: "DelayRes (with follow up)",
    0xFF42: "DelayFollowUpRes",
    0xFF43: "DelayRes",
}
#: Octets before SequenceID, and between it and the delay.
_RESERVED, _BETWEEN = 12, 2


class TlvType:
    """Coding of TypeLength.Type, seven bits."""

    END = 0x00
    SUBDOMAIN = 0x01
    TIME = 0x02
    TIME_EXTENSION = 0x03
    MASTER = 0x04
    PORT_PARAMETER = 0x05
    DELAY_PARAMETER = 0x06
    PORT_TIME = 0x07
    OPTION = 0x7F


@dataclass(frozen=True, slots=True)
class PtcpTlv:
    """One TLV; ``value`` of up to 511 octets."""

    type: int
    value: bytes = b""


@dataclass(frozen=True, slots=True)
class PtcpPdu:
    """``delay_ns`` is the last field of the head, nanoseconds; sync frames add to it the value in ``head``."""

    frame_id: int
    sequence: int
    delay_ns: int = 0
    tlvs: tuple[PtcpTlv, ...] = ()
    head: bytes = bytes(_RESERVED)
    between: bytes = bytes(_BETWEEN)

    def _value(self, tlv_type: int, least: int) -> bytes | None:
        return next((tlv.value for tlv in self.tlvs if tlv.type == tlv_type and len(tlv.value) >= least), None)

    @property
    def master(self) -> bytes | None:
        """MAC address of the clock's master, where a Subdomain TLV names it."""
        value = self._value(TlvType.SUBDOMAIN, 22)
        return None if value is None else value[:6]

    @property
    def subdomain(self) -> UUID | None:
        """The clock's domain, where a Subdomain TLV names it."""
        value = self._value(TlvType.SUBDOMAIN, 22)
        return None if value is None else UUID(bytes=value[6:22])

    @property
    def port_mac(self) -> bytes | None:
        """The port whose cable is measured."""
        value = self._value(TlvType.DELAY_PARAMETER, 6)
        return None if value is None else value[:6]


def parse_ptcp(data: bytes) -> PtcpPdu:
    """``data`` begins with the frame id; what follows the End TLV is padding, a missing End is accepted.

    Reasons: ``bad-type`` (not a frame id of PTCP), ``short``.
    """
    r = Reader(data)
    frame_id = r.u16()
    if frame_id not in PTCP_NAMES:
        raise DecodeError("bad-type", f"frame id 0x{frame_id:04X} is not PTCP's")
    head, sequence, between, delay = r.bytes(_RESERVED), r.u16(), r.bytes(_BETWEEN), r.u32()
    tlvs: list[PtcpTlv] = []
    while r.remaining:
        word = r.u16()
        if word >> 9 == TlvType.END:
            break
        tlvs.append(PtcpTlv(word >> 9, r.bytes(word & 0x01FF)))
    return PtcpPdu(frame_id, sequence, delay, tuple(tlvs), head, between)


def emit_ptcp(pdu: PtcpPdu) -> bytes:
    """From the frame id to the End TLV; :class:`ValueError` when a field does not fit."""
    w = Writer().u16(pdu.frame_id).bytes(pdu.head).u16(pdu.sequence).bytes(pdu.between).u32(pdu.delay_ns)
    for tlv in pdu.tlvs:
        if not 0 < tlv.type <= TlvType.OPTION or len(tlv.value) > 0x01FF:
            raise ValueError(f"a TLV of type {tlv.type} and {len(tlv.value)} octets does not fit")
        w.u16(tlv.type << 9 | len(tlv.value)).bytes(tlv.value)
    return w.u16(0).getvalue()
