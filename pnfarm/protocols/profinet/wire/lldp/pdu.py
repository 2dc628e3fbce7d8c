"""LLDPDUs: who is at the other end of a cable (IEEE 802.1AB-2016 clause 8; IEC 61158-6-10, LLDP).

An LLDPDU is a series of TLVs: chassis, port and time to live first, in this order, then optional ones, then an
end.  PROFINET adds TLVs of its own organisation (00-0E-CF) and requires the MAC/PHY status of IEEE 802.3
(00-12-0F).

A TLV after the first three whose value does not have its type's shape parses as :class:`RawTlv`, octet for
octet: one bad TLV does not hide the neighbour.

Two naming schemes are in use (:class:`NameMode`); :func:`peer_names` reads both.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.lldp.tlvs import LONGEST_TEXT, ChassisId, PortId, TlvType, shape_tlv, tlv_value
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.lldp.tlvs import Tlv

__all__ = ["LLDP_MULTICAST", "Lldpdu", "NameMode", "emit_lldp", "parse_lldp", "peer_names"]

#: IEEE 802.1AB-2016 table 7-1: nearest bridge; no bridge forwards it.
LLDP_MULTICAST = bytes.fromhex("0180c200000e")

_LONGEST_VALUE = 511


class NameMode(IntEnum):
    """MultipleInterfaceMode.NameOfDevice (IEC 61158-6-10): where an LLDPDU carries the NameOfStation.

    PORT is the default: the port id is ``port-001``, the chassis id is the NameOfStation, or the MAC address while
    there is none.  PORT_AND_STATION: the port id is ``port-001.name-of-station``, the chassis id describes the product.
    """

    PORT = 0
    PORT_AND_STATION = 1


@dataclass(frozen=True, slots=True)
class Lldpdu:
    """One LLDPDU; ``time_to_live`` in seconds, 0 for a port that is being shut down; ``tlvs`` in their order."""

    chassis: ChassisId
    port: PortId
    time_to_live: int
    tlvs: tuple[Tlv, ...] = ()


# -- parse -----------------------------------------------------------------------------------------------------------


def parse_lldp(data: bytes | bytearray | memoryview) -> Lldpdu:
    """LLDPDU from an Ethernet payload; what follows the end TLV is padding.  A missing end is accepted.

    Reasons: ``short`` (a TLV runs over the end), ``bad-order`` (the first three are not chassis, port, time to live),
    ``duplicate`` (one of these three comes again), ``bad-length`` (identifier, time to live or end of another size).
    """
    reader = Reader(data)
    chassis = ChassisId.parse(_identifier(reader, TlvType.CHASSIS_ID))
    port = PortId.parse(_identifier(reader, TlvType.PORT_ID))
    ttl = _next(reader, TlvType.TIME_TO_LIVE)
    if len(ttl) != 2:
        raise DecodeError("bad-length", f"a time to live of {len(ttl)} octets")
    tlvs: list[Tlv] = []
    while reader.remaining:
        header = reader.u16()
        kind, length = header >> 9, header & 0x1FF
        if kind == TlvType.END:
            if length:
                raise DecodeError("bad-length", f"an end with {length} octets")
            break
        if kind <= TlvType.TIME_TO_LIVE:
            raise DecodeError("duplicate", f"a second {TlvType(kind).name}")
        tlvs.append(shape_tlv(kind, reader.bytes(length)))
    return Lldpdu(chassis, port, int.from_bytes(ttl, "big"), tuple(tlvs))


def _next(reader: Reader, wanted: TlvType) -> bytes:
    header = reader.u16()
    if header >> 9 != wanted:
        raise DecodeError("bad-order", f"TLV {header >> 9} where {wanted.name} is expected")
    return reader.bytes(header & 0x1FF)


def _identifier(reader: Reader, wanted: TlvType) -> bytes:
    value = _next(reader, wanted)
    if not 2 <= len(value) <= LONGEST_TEXT + 1:
        raise DecodeError("bad-length", f"{wanted.name} of {len(value)} octets")
    return value


# -- emit ------------------------------------------------------------------------------------------------------------


def emit_lldp(pdu: Lldpdu) -> bytes:
    """Octets of an LLDPDU with its end; :class:`ValueError` when a field does not fit."""
    writer = Writer()
    for kind, identifier in ((TlvType.CHASSIS_ID, pdu.chassis), (TlvType.PORT_ID, pdu.port)):
        if not 1 <= len(identifier.value) <= LONGEST_TEXT:
            raise ValueError(f"{kind.name} of {len(identifier.value)} octets: 1 to {LONGEST_TEXT} fit")
        _put(writer, kind, identifier.emit())
    _put(writer, TlvType.TIME_TO_LIVE, Writer().u16(pdu.time_to_live).getvalue())
    for tlv in pdu.tlvs:
        _put(writer, *tlv_value(tlv))
    _put(writer, TlvType.END, b"")
    return writer.getvalue()


def _put(writer: Writer, kind: int, value: bytes) -> None:
    if not (0 <= kind <= 127 and len(value) <= _LONGEST_VALUE):
        raise ValueError(f"TLV {kind} of {len(value)} octets does not fit: 0 to 127, {_LONGEST_VALUE} octets")
    writer.u16(kind << 9 | len(value)).bytes(value)


def peer_names(chassis: ChassisId, port: PortId) -> tuple[str, str]:
    """(name of port, name of station) of the sender, in either :class:`NameMode`.

    A station without a name goes by its MAC address.
    """
    name, dot, station = port.text.partition(".")
    return (name, station) if dot and station else (port.text, chassis.text)
