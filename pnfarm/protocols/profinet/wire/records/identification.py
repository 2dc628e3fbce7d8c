"""Blocks that records carry: identification and maintenance, identification data, AR and API data,
the I/O data of one submodule (IEC 61158-6-10; I&M: PI profile guideline 1)."""

from enum import IntEnum
from typing import Annotated, Any, Self

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import ALIGNED, VERSION_1_0, VERSION_1_1, Block, BlockType, RawBlock
from pnfarm.wire.layout import (
    Count,
    Fixed,
    List16,
    Octets8,
    Octets16,
    Outside,
    Rest,
    RestBut,
    Structure,
    UInt8,
    UInt16,
    UInt32,
    Uuid,
    padded,
)
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "IM_TEXT_SIZES",
    "ApiData",
    "ArData",
    "ArDataEntry",
    "ArDataIocr",
    "IdentificationApi",
    "IdentificationData",
    "IdentificationSlot",
    "Im0",
    "ImText",
    "RecordInputData",
    "RecordOutputData",
    "SubstituteValue",
    "SubstitutionMode",
]

_FILTER_TYPES = (
    BlockType.IM0_FILTER_DATA_SUBMODULE,
    BlockType.IM0_FILTER_DATA_MODULE,
    BlockType.IM0_FILTER_DATA_DEVICE,
)
_IDENTIFICATION_TYPES = (BlockType.EXPECTED_IDENTIFICATION_DATA, BlockType.REAL_IDENTIFICATION_DATA)

#: Octets of text in I&M1 (tag function 32, tag location 22), I&M2 (date), I&M3 (descriptor), I&M4 (signature).
IM_TEXT_SIZES = {BlockType.IM1: 54, BlockType.IM2: 16, BlockType.IM3: 54, BlockType.IM4: 54}


def _software_revision(prefix: int, *numbers: int) -> tuple[str, int, int, int]:
    one, two, three = numbers
    return chr(prefix), one, two, three


class Im0(Block, types=BlockType.IM0):
    """0x0020.  ``order_id`` is padded with blanks to 20 octets, ``serial_number`` to 16."""

    vendor_id: UInt16
    order_id: Annotated[bytes, padded(20)]
    serial_number: Annotated[bytes, padded(16)]
    hardware_revision: UInt16
    software_revision: Annotated[
        tuple[str, int, int, int], Fixed("BBBB", _software_revision, lambda value: (ord(value[0]), *value[1:]))
    ]
    revision_counter: UInt16 = 0
    profile_id: UInt16 = 0
    profile_specific_type: UInt16 = 0
    im_version: UInt16 = 0x0101
    im_supported: UInt16 = 0
    version: Outside[int] = VERSION_1_0


class ImText(Block, types=IM_TEXT_SIZES):
    """0x0021 - 0x0024, I&M1 to I&M4: text of a fixed size, see :data:`IM_TEXT_SIZES`."""

    block_type: Outside[int]
    text: Rest
    version: Outside[int] = VERSION_1_0

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        return cls(block.block_type, r.bytes(IM_TEXT_SIZES[BlockType(block.block_type)]), block.version)


class IdentificationSlot(Structure):
    """``submodules`` are (subslot, submodule ident)."""

    slot: UInt16
    module_ident: UInt32
    submodules: List16[tuple[UInt16, UInt32]]


class IdentificationApi(Structure):
    api: UInt32
    slots: List16[IdentificationSlot]


class IdentificationData(Block, types=(*_IDENTIFICATION_TYPES, *_FILTER_TYPES)):
    """0x0012 expected, 0x0013 real identification, 0x0030 - 0x0032 I&M0 filter: all list submodules.

    Version 1.0 of the identification blocks names no API (there is one, API 0); 1.1 does, as the filters do.
    """

    block_type: Outside[int]
    apis: List16[IdentificationApi]
    version: Outside[int] = VERSION_1_1

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        if _names_api(block.block_type, block.version):
            return super().read_body(r, block)
        return cls(block.block_type, (IdentificationApi.parse(bytes(4) + r.rest()),), block.version)

    def write_body(self, w: Writer) -> None:
        """Raises :class:`ValueError` for a version 1.0 identification that names another API than 0."""
        if _names_api(self.block_type, self.version):
            super().write_body(w)
        elif [api.api for api in self.apis] == [0]:
            w.bytes(self.apis[0].emit()[4:])
        else:
            raise ValueError("version 1.0 of identification data holds exactly API 0")


def _names_api(block_type: int, version: int) -> bool:
    return block_type in _FILTER_TYPES or version != VERSION_1_0


class ApiData(Block, types=BlockType.API_DATA):
    """0x001A: the APIs that the device has."""

    apis: List16[UInt32]
    version: Outside[int] = VERSION_1_0


class ArDataIocr(Structure):
    """``apdu_status`` is cycle counter, data status, transfer status, as a frame ends."""

    properties: UInt32
    iocr_type: UInt16
    frame_id: UInt16
    apdu_status: UInt32 = 0


class ArDataEntry(
    Structure,
    wire="ar_uuid initiator_object_uuid parameter_server_object_uuid properties ar_type alarm_cr_type "
    "local_alarm_reference remote_alarm_reference initiator_udp_rt_port responder_udp_rt_port initiator_station_name "
    "parameter_server_station_name iocrs apis",
):
    """One AR of ARData, version 1.1, without the optional ARDataInfo blocks."""

    ar_uuid: Uuid
    initiator_object_uuid: Uuid
    parameter_server_object_uuid: Uuid
    properties: UInt32
    ar_type: UInt16
    alarm_cr_type: UInt16
    local_alarm_reference: UInt16
    remote_alarm_reference: UInt16
    initiator_udp_rt_port: UInt16
    responder_udp_rt_port: UInt16
    initiator_station_name: Octets16
    iocrs: Annotated[tuple[ArDataIocr, ...], ALIGNED, Count("H", ALIGNED)]
    apis: Annotated[tuple[UInt32, ...], Count("H", ALIGNED)]
    parameter_server_station_name: Annotated[Octets16, ALIGNED] = b""

    @classmethod
    def read(cls, r: Reader, **_outside: Any) -> Self:
        value = super().read(r)
        if r.u16():
            raise DecodeError("unsupported", "ARData with ARDataInfo blocks")
        ALIGNED.read(r, {})
        return value

    def write(self, w: Writer) -> None:
        super().write(w)
        ALIGNED.write(w.u16(0), {})


class ArData(Block, types=BlockType.AR_DATA):
    """0x0018, version 1.1: the established ARs."""

    ars: List16[ArDataEntry]
    version: Outside[int] = VERSION_1_1

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        """Raises ``unsupported`` for another version than 1.1 and for ARDataInfo blocks."""
        if block.version != VERSION_1_1:
            raise DecodeError("unsupported", f"ARData of version 0x{block.version:04X}")
        return super().read_body(r, block)


class SubstitutionMode(IntEnum):
    """Coding of the field SubstitutionMode."""

    ZERO = 0
    LAST_VALUE = 1
    REPLACEMENT_VALUE = 2


class SubstituteValue(Block, types=BlockType.SUBSTITUTE_VALUE):
    """0x0014: what a submodule puts out when its outputs fail; both statuses have one octet."""

    mode: UInt16
    iocs: UInt8
    data: Annotated[bytes, RestBut(1)]
    iops: UInt8
    version: Outside[int] = VERSION_1_0


class RecordInputData(Block, types=BlockType.RECORD_INPUT_DATA_OBJECT):
    """0x0015, RecordInputDataObjectElement: inputs of one submodule with both statuses."""

    iocs: Octets8
    iops: Octets8
    data: Octets16
    version: Outside[int] = VERSION_1_0


class RecordOutputData(Block, types=BlockType.RECORD_OUTPUT_DATA_OBJECT):
    """0x0016, RecordOutputDataObjectElement; ``substitute`` is the SubstituteValue block's octets, if any."""

    iocs: Outside[bytes]
    iops: Outside[bytes]
    data: Outside[bytes]
    substitute_active: UInt16 = 0
    substitute: Outside[bytes] = b""
    version: Outside[int] = VERSION_1_0

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        active, iocs_length, iops_length, data_length = r.u16(), r.u8(), r.u8(), r.u16()
        iocs, data, iops = r.bytes(iocs_length), r.bytes(data_length), r.bytes(iops_length)
        return cls(iocs, iops, data, active, r.rest(), block.version)

    def write_body(self, w: Writer) -> None:
        w.u16(self.substitute_active).u8(len(self.iocs)).u8(len(self.iops)).u16(len(self.data))
        w.bytes(self.iocs).bytes(self.data).bytes(self.iops).bytes(self.substitute)
