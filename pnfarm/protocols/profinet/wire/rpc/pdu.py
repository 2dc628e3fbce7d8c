"""Connectionless DCE/RPC as PROFINET's context management uses it: header, NDR arguments, status bodies.

Sources: C706 (DCE 1.1: Remote Procedure Call) chapter 12 for the PDUs and appendix E for the status codes;
IEC 61158-6-10 clause 4.10 (RPC substitutions, NDR data) for what PROFINET puts into them.

Integers and UUIDs follow the *data representation* octets of the header (``drep``): big-endian when the upper
nibble of the first octet is 0, little-endian when it is 1.  The blocks inside of the NDR arguments are
big-endian always and stay opaque here.
"""

import struct
from enum import IntEnum
from typing import Final
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.wire.code import Code
from pnfarm.wire.layout import Structure, UInt8
from pnfarm.wire.octets import Reader, Writer, pack, uuid_of
from pnfarm.wire.value import value_class

__all__ = [
    "ARGS_HEADER_LENGTH",
    "BODY_MAX",
    "DREP_BIG",
    "DREP_LITTLE",
    "FRAGMENT_NONE",
    "HEADER_LENGTH",
    "NIL_UUID",
    "OK",
    "RPC_PORT",
    "UUID_EPM",
    "UUID_PNIO_CONTROLLER",
    "UUID_PNIO_DEVICE",
    "Flags1",
    "NcaStatus",
    "Opnum",
    "PacketType",
    "PnioStatus",
    "RequestArgs",
    "ResponseArgs",
    "RpcPdu",
    "args_length_invalid",
    "device_of",
    "drep",
    "emit_request_args",
    "emit_response_args",
    "emit_rpc",
    "emit_status",
    "object_uuid",
    "parse_request_args",
    "parse_response_args",
    "parse_rpc",
    "parse_status",
    "status_name",
]

RPC_PORT: Final = 0x8894
"""UDP port of PROFINET's context management and of its endpoint mapper (IEC 61158-6-10, 4.13.3.2)."""

RPC_VERSION: Final = 4
HEADER_LENGTH: Final = 80
BODY_MAX: Final = 1384
"""Octets of body that every receiver takes in one PDU: C706's must-receive size of 1464 less the header."""

DREP_BIG: Final = b"\x00\x00\x00"
DREP_LITTLE: Final = b"\x10\x00\x00"
HINT_NONE: Final = 0xFFFF
FRAGMENT_NONE: Final = 0xFFFF
"""Fragment number of a fack or nocall while nothing has arrived in order (C706 12.5.3)."""

NIL_UUID: Final = UUID(int=0)
# IEC 61158-6-10, 4.10.3.2: interface UUIDs
UUID_PNIO_DEVICE: Final = UUID("dea00001-6c97-11d1-8271-00a02442df7d")
UUID_PNIO_CONTROLLER: Final = UUID("dea00002-6c97-11d1-8271-00a02442df7d")
# C706 appendix O
UUID_EPM: Final = UUID("e1af8308-5d1f-11c9-91a4-08002b14a0fa")

_OBJECT_PREFIX: Final = bytes.fromhex("dea000006c9711d18271")
_NODE: Final = struct.Struct(">HHH")


class PacketType(IntEnum):
    """C706 table "RPC Protocol Data Units"; only the lower five bits of the octet count."""

    REQUEST = 0
    PING = 1
    RESPONSE = 2
    FAULT = 3
    WORKING = 4
    NOCALL = 5
    REJECT = 6
    ACK = 7
    CL_CANCEL = 8
    FACK = 9
    CANCEL_ACK = 10


class Flags1(IntEnum):
    """C706 12.5.2.3."""

    LAST_FRAGMENT = 0x02
    FRAGMENT = 0x04
    NO_FACK = 0x08
    MAYBE = 0x10
    IDEMPOTENT = 0x20
    BROADCAST = 0x40


# with which each PDU is compared: looked up once
_FRAGMENT = int(Flags1.FRAGMENT)
_LAST_FRAGMENT = int(Flags1.LAST_FRAGMENT)
_NO_FACK = int(Flags1.NO_FACK)
_IDEMPOTENT = int(Flags1.IDEMPOTENT)
_UNANSWERED = int(Flags1.MAYBE | Flags1.BROADCAST)


class Opnum(IntEnum):
    """Operations of the PNIO interfaces (IEC 61158-6-10, 4.10.3.2)."""

    CONNECT = 0
    RELEASE = 1
    READ = 2
    WRITE = 3
    CONTROL = 4
    READ_IMPLICIT = 5


class NcaStatus(Code):
    """Status codes of reject and fault bodies (C706 appendix E)."""

    FAULT_INVALID_BOUND = 0x1C000007
    RPC_VERSION_MISMATCH = 0x1C000008
    UNSPEC_REJECT = 0x1C000009
    BAD_ACTID = 0x1C00000A
    WHO_ARE_YOU_FAILED = 0x1C00000B
    MANAGER_NOT_ENTERED = 0x1C00000C
    FAULT_CANCEL = 0x1C00000D
    FAULT_UNSPEC = 0x1C000012
    FAULT_REMOTE_COMM_FAILURE = 0x1C000013
    FAULT_CONTEXT_MISMATCH = 0x1C00001A
    FAULT_REMOTE_NO_MEMORY = 0x1C00001B
    UNSUPPORTED_AUTHN_LEVEL = 0x1C00001D
    INVALID_CHECKSUM = 0x1C00001F
    INVALID_CRC = 0x1C000020
    FAULT_OBJECT_NOT_FOUND = 0x1C000024
    COMM_FAILURE = 0x1C010001
    OP_RNG_ERROR = 0x1C010002
    UNK_IF = 0x1C010003
    WRONG_BOOT_TIME = 0x1C010006
    YOU_CRASHED = 0x1C010009
    PROTO_ERROR = 0x1C01000B
    OUT_ARGS_TOO_BIG = 0x1C010013
    SERVER_TOO_BUSY = 0x1C010014
    UNSUPPORTED_TYPE = 0x1C010017


def status_name(code: int) -> str:
    """The name C706 gives to a reject or fault status, such as ``nca_unk_if``; the number where it has none."""
    known = NcaStatus.find(code)
    return f"0x{code:08x}" if known is None else f"nca_{known.name.lower()}"


def object_uuid(instance: int, device_id: int, vendor_id: int) -> UUID:
    """The object UUID of an IO device: instance, device and vendor in its node (IEC 61158-6-10, 4.10.3.2)."""
    return UUID(bytes=_OBJECT_PREFIX + _NODE.pack(instance, device_id, vendor_id))


def device_of(called: UUID) -> tuple[int, int, int]:
    """Instance, device and vendor of an object UUID."""
    instance, device_id, vendor_id = _NODE.unpack(called.bytes[len(_OBJECT_PREFIX) :])
    return instance, device_id, vendor_id


def drep(*, little_endian: bool) -> bytes:
    """The three octets of data representation: ASCII, IEEE floats and the given integer order."""
    return DREP_LITTLE if little_endian else DREP_BIG


_LAYOUT: Final = "4B3sB16s16s16s3I5H2B"
"""The header from the version to the lower half of the serial number (C706 12.5.1)."""
_HEADERS: Final = (struct.Struct(f">{_LAYOUT}"), struct.Struct(f"<{_LAYOUT}"))
"""Big-endian and little-endian."""


# --- the PDU (C706 12.5.1) ---------------------------------------------------------------------------------


@value_class
class RpcPdu:
    """One connectionless PDU.

    ``interface_version`` holds the major version in its lower and the minor one in its upper 16 bits.  ``serial``
    counts the transmissions of one call.  ``trailer`` is what follows the body, where C706 puts an
    authentication verifier; PROFINET has none.
    """

    packet_type: int
    interface: UUID
    activity: UUID
    object_uuid: UUID = NIL_UUID
    sequence: int = 0
    opnum: int = 0
    body: bytes = b""
    flags1: int = 0
    flags2: int = 0
    drep: bytes = DREP_LITTLE
    server_boot_time: int = 0
    interface_version: int = 1
    interface_hint: int = HINT_NONE
    activity_hint: int = HINT_NONE
    fragment_number: int = 0
    serial: int = 0
    auth_protocol: int = 0
    trailer: bytes = b""

    @property
    def kind(self) -> int:
        """The packet type without the three bits that C706 leaves to implementations."""
        return self.packet_type & 0x1F

    @property
    def little_endian(self) -> bool:
        return self.drep[0] >> 4 == 1

    @property
    def is_fragment(self) -> bool:
        return bool(self.flags1 & _FRAGMENT)

    @property
    def is_last(self) -> bool:
        """True of the last fragment, and of an unfragmented PDU."""
        return not self.is_fragment or bool(self.flags1 & _LAST_FRAGMENT)

    @property
    def wants_fack(self) -> bool:
        return self.is_fragment and not self.flags1 & _NO_FACK

    @property
    def idempotent(self) -> bool:
        """Whether the client allows that the call runs twice."""
        return bool(self.flags1 & _IDEMPOTENT)

    @property
    def unanswered(self) -> bool:
        """Whether the client wants no answer, or sent it to all."""
        return bool(self.flags1 & _UNANSWERED)


def parse_rpc(data: bytes) -> RpcPdu:
    """Read one UDP payload.

    Raises :class:`DecodeError` with ``short``, ``bad-version`` (not 4) or ``bad-drep`` (an integer format that
    C706 does not define).
    """
    reader = Reader(data)
    version = reader.u8()
    if version != RPC_VERSION:
        raise DecodeError("bad-version", f"RPC version {version}, {RPC_VERSION} is the connectionless one")
    reader.skip(3)
    representation = reader.bytes(3)
    if representation[0] >> 4 > 1:
        raise DecodeError("bad-drep", f"integer format {representation[0] >> 4}")
    little = representation[0] >> 4 == 1
    reader.skip(HEADER_LENGTH - reader.position)
    (
        _, packet_type, flags1, flags2, _, serial_high, object_, interface, activity, boot_time, interface_version,
        sequence, opnum, interface_hint, activity_hint, length, fragment, auth_protocol, serial_low,
    ) = _HEADERS[little].unpack_from(data)  # fmt: skip
    body = reader.bytes(length)
    return RpcPdu(
        packet_type=packet_type,
        interface=uuid_of(interface, little=little),
        activity=uuid_of(activity, little=little),
        object_uuid=uuid_of(object_, little=little),
        sequence=sequence,
        opnum=opnum,
        body=body,
        flags1=flags1,
        flags2=flags2,
        drep=representation,
        server_boot_time=boot_time,
        interface_version=interface_version,
        interface_hint=interface_hint,
        activity_hint=activity_hint,
        fragment_number=fragment,
        serial=serial_high << 8 | serial_low,
        auth_protocol=auth_protocol,
        trailer=reader.rest(),
    )


def emit_rpc(pdu: RpcPdu, *, server_boot_time: int | None = None) -> bytes:
    """The UDP payload of ``pdu``, with another boot time if one is given.

    Raises :class:`ValueError` where a field does not fit.
    """
    little = pdu.little_endian
    if len(pdu.drep) != 3:
        raise ValueError(f"data representation has {len(pdu.drep)} octets, 3 are expected")
    identifiers = pdu.object_uuid, pdu.interface, pdu.activity
    header = pack(
        _HEADERS[little],
        RPC_VERSION, pdu.packet_type, pdu.flags1, pdu.flags2, pdu.drep, pdu.serial >> 8,
        *(identifier.bytes_le if little else identifier.bytes for identifier in identifiers),
        pdu.server_boot_time if server_boot_time is None else server_boot_time, pdu.interface_version, pdu.sequence,
        pdu.opnum, pdu.interface_hint, pdu.activity_hint, len(pdu.body), pdu.fragment_number,
        pdu.auth_protocol, pdu.serial & 0xFF,
    )  # fmt: skip
    return header + pdu.body + pdu.trailer


# --- PNIOStatus (IEC 61158-6-10, 5.2.6) --------------------------------------------------------------------


class PnioStatus(Structure):
    """What an operation ended with; four octets, ``error_code`` the most significant of the NDR integer."""

    error_code: UInt8 = 0
    error_decode: UInt8 = 0
    error_code1: UInt8 = 0
    error_code2: UInt8 = 0

    @property
    def ok(self) -> bool:
        return not (self.error_code or self.error_decode or self.error_code1 or self.error_code2)

    def __int__(self) -> int:
        return self.error_code << 24 | self.error_decode << 16 | self.error_code1 << 8 | self.error_code2

    @classmethod
    def from_int(cls, value: int) -> "PnioStatus":
        return cls(value >> 24 & 0xFF, value >> 16 & 0xFF, value >> 8 & 0xFF, value & 0xFF)


OK: Final = PnioStatus()

_ERROR_DECODE_PNIO: Final = 0x81
_ERROR_CODE1_CMRPC: Final = 0x40
_ERROR_CODE2_ARGS_LENGTH_INVALID: Final = 0
# IEC 61158-6-10, values of ErrorCode
_ERROR_CODES: Final[dict[int, int]] = {
    Opnum.CONNECT: 0xDB,
    Opnum.RELEASE: 0xDC,
    Opnum.READ: 0xDE,
    Opnum.WRITE: 0xDF,
    Opnum.CONTROL: 0xDD,
    Opnum.READ_IMPLICIT: 0xDE,
}


def args_length_invalid(opnum: int) -> PnioStatus:
    """The status for NDR lengths that contradict each other: CMRPC, "args length invalid"."""
    return PnioStatus(
        _ERROR_CODES.get(opnum, 0xDB), _ERROR_DECODE_PNIO, _ERROR_CODE1_CMRPC, _ERROR_CODE2_ARGS_LENGTH_INVALID
    )


# --- NDR arguments (IEC 61158-6-10, 4.10.3.2: NDRDataRequest, NDRDataResponse) -------------------------------


ARGS_HEADER_LENGTH: Final = 20
"""Octets before the blocks: ArgsMaximum or the status, ArgsLength, MaximumCount, Offset, ActualCount."""


@value_class
class RequestArgs:
    """Arguments of a request: how long the answer may be, and the blocks.

    ``maximum_count`` is that of another request than the standard asks for, None where it is ``args_maximum``.
    """

    args_maximum: int
    payload: bytes
    maximum_count: int | None = None


@value_class
class ResponseArgs:
    """Arguments of a response: the status and the blocks; ``maximum_count`` repeats the request's ArgsMaximum."""

    status: PnioStatus
    payload: bytes
    maximum_count: int


def _read_array(reader: Reader) -> tuple[int, bytes]:
    """ArgsLength, then the NDR conformant varying array; answers MaximumCount and the octets."""
    length, maximum, offset, actual = reader.u32(), reader.u32(), reader.u32(), reader.u32()
    if offset:
        raise DecodeError("bad-offset", f"array offset {offset}, 0 is expected")
    if actual != reader.remaining:
        raise DecodeError("bad-length", f"ActualCount {actual}, {reader.remaining} octets present")
    if length != actual:
        raise DecodeError("bad-length", f"ArgsLength {length}, ActualCount {actual}")
    if actual > maximum:
        raise DecodeError("bad-length", f"ActualCount {actual} above MaximumCount {maximum}")
    return maximum, reader.rest()


def _emit_args(first: int, maximum: int, payload: bytes, *, little: bool) -> bytes:
    size = len(payload)
    return Writer(little).u32(first).u32(size).u32(maximum).u32(0).u32(size).bytes(payload).getvalue()


def parse_request_args(stub: bytes, *, little_endian: bool) -> RequestArgs:
    """Read the stub of a request; ``short``, ``bad-offset`` or ``bad-length`` where it contradicts itself."""
    reader = Reader(stub, little_endian)
    args_maximum = reader.u32()
    maximum, payload = _read_array(reader)
    return RequestArgs(args_maximum, payload, None if maximum == args_maximum else maximum)


def emit_request_args(args: RequestArgs, *, little_endian: bool) -> bytes:
    maximum = args.args_maximum if args.maximum_count is None else args.maximum_count
    return _emit_args(args.args_maximum, maximum, args.payload, little=little_endian)


def parse_response_args(stub: bytes, *, little_endian: bool) -> ResponseArgs:
    """Read the stub of a response; ``short``, ``bad-offset`` or ``bad-length`` where it contradicts itself."""
    reader = Reader(stub, little_endian)
    status = PnioStatus.from_int(reader.u32())
    maximum, payload = _read_array(reader)
    return ResponseArgs(status, payload, maximum)


def emit_response_args(args: ResponseArgs, *, little_endian: bool) -> bytes:
    return _emit_args(int(args.status), args.maximum_count, args.payload, little=little_endian)


# --- bodies of reject and fault (C706 12.5.3.6, 12.5.3.10) ---------------------------------------------------


def parse_status(body: bytes, *, little_endian: bool) -> int:
    """The status of a reject or fault; what some stacks append to it is ignored, as C706 asks."""
    return Reader(body, little_endian).u32()


def emit_status(status: int, *, little_endian: bool) -> bytes:
    return Writer(little_endian).u32(status).getvalue()
