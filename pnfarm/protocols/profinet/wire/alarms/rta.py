"""RTA-PDU: what carries alarms, their acknowledgements and the end of an AR (IEC 61158-6-10, RTA-PDU).

``FrameID u16, AlarmDstEndpoint u16, AlarmSrcEndpoint u16, PDUType u8, AddFlags u8, SendSeqNum u16, AckSeqNum u16,
VarPartLen u16, VarPart``, after EtherType 0x8892.  The endpoints are the alarm references that both ends exchanged at
Connect.  A DATA-RTA-PDU carries one alarm block, an ERR-RTA-PDU a PNIOStatus, the other two nothing.
"""

from enum import IntEnum

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import rta_status
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus
from pnfarm.wire.layout import Octets16, Structure, UInt8, UInt16
from pnfarm.wire.octets import Reader

__all__ = [
    "FIRST_ACK",
    "FIRST_SEND",
    "RTA_VERSION",
    "TACK",
    "WINDOW_SIZE",
    "RtaPdu",
    "RtaType",
    "error_status",
    "next_sequence",
    "parse_rta",
    "rta_error",
]


class RtaType(IntEnum):
    """PDUType.Type, bits 0 to 3; other values are reserved."""

    DATA = 1
    NACK = 2
    ACK = 3
    ERR = 4


#: PDUType.Version, bits 4 to 7.
RTA_VERSION = 1
#: AddFlags.WindowSize, bits 0 to 2: one DATA-RTA-PDU may be without its acknowledgement.
WINDOW_SIZE = 0x01
#: AddFlags.TACK, bit 4: the receiver acknowledges at once.
TACK = 0x10

#: SendSeqNum of the first DATA-RTA-PDU, and AckSeqNum of an end that has received none.
FIRST_SEND = 0xFFFF
FIRST_ACK = 0xFFFE
#: After the first number the counters run from 0 to here and start again.
_HIGHEST_SEQUENCE = 0x7FFF


class RtaPdu(Structure):
    """One PDU; ``destination`` and ``source`` are alarm references, ``body`` is the VarPart."""

    frame_id: UInt16
    destination: UInt16
    source: UInt16
    pdu_type: UInt8
    add_flags: UInt8
    send_sequence: UInt16
    ack_sequence: UInt16
    body: Octets16 = b""

    @property
    def type(self) -> int:
        """One of :class:`RtaType`, or a reserved number."""
        return self.pdu_type & 0x0F

    @property
    def version(self) -> int:
        return self.pdu_type >> 4

    @property
    def tack(self) -> bool:
        return bool(self.add_flags & TACK)


def next_sequence(number: int) -> int:
    """What follows a SendSeqNum: 0 after the first one, then one more each time, modulo 0x8000."""
    return (number + 1) & _HIGHEST_SEQUENCE


def parse_rta(data: bytes) -> RtaPdu:
    """``data`` starts with the frame id; what follows the PDU is padding of the Ethernet frame.

    Raises :class:`DecodeError`: ``bad-type`` for a frame id that is not an alarm's, ``short``.  PDUs of reserved types
    and versions are values like any other.
    """
    r = Reader(data)
    frame_id = r.u16()
    if frame_id not in {ALARM_HIGH, ALARM_LOW}:
        raise DecodeError("bad-type", f"frame id 0x{frame_id:04X} is not an alarm's")
    return RtaPdu.read(Reader(data))


# ERR-RTA-PDU: how either end of an AR reports its end


def rta_error(
    destination: int, source: int, code: int, send_sequence: int = FIRST_SEND, ack_sequence: int = FIRST_ACK
) -> RtaPdu:
    """With the status CF 81 FD ``code`` (:class:`~pnfarm.protocols.profinet.errors.RtaError`), of low priority."""
    kind = RTA_VERSION << 4 | RtaType.ERR
    status = rta_status(code).emit()
    return RtaPdu(ALARM_LOW, destination, source, kind, WINDOW_SIZE, send_sequence, ack_sequence, status)


def error_status(pdu: RtaPdu) -> PnioStatus:
    """That of an ERR-RTA-PDU; the vendor's octets may follow it.  Raises :class:`DecodeError` (``short``)."""
    return PnioStatus.read(Reader(pdu.body))
