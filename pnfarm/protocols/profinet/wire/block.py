"""The block: the unit that PDUs of PROFINET context management consist of (IEC 61158-6-10, BlockHeader).

A block is ``BlockType u16, BlockLength u16, BlockVersionHigh u8, BlockVersionLow u8, body``; the
length counts everything after itself, so it is the body's plus two.  This file holds what all
families share; the families are in :mod:`~pnfarm.protocols.profinet.wire.cm` and
:mod:`~pnfarm.protocols.profinet.wire.records`, and :mod:`any_block` joins them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from enum import IntEnum
from typing import Any, ClassVar, Self

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import Align, Codec, Rest, Structure, UInt16
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "ALIGNED",
    "BLOCK_HEADER_SIZE",
    "RESPONSE",
    "VERSION_1_0",
    "VERSION_1_1",
    "Block",
    "BlockType",
    "Blocks",
    "RawBlock",
    "expect_padding",
    "split_blocks",
]

BLOCK_HEADER_SIZE = 6
#: BlockVersionHigh << 8 | BlockVersionLow.
VERSION_1_0 = 0x0100
VERSION_1_1 = 0x0101
#: A response's BlockType is its request's with this bit.
RESPONSE = 0x8000


class BlockType(IntEnum):
    """IEC 61158-6-10, coding of the field BlockType: the ones this package knows by name."""

    IOD_WRITE_REQ = 0x0008
    IOD_READ_REQ = 0x0009
    DIAGNOSIS_DATA = 0x0010
    EXPECTED_IDENTIFICATION_DATA = 0x0012
    REAL_IDENTIFICATION_DATA = 0x0013
    SUBSTITUTE_VALUE = 0x0014
    RECORD_INPUT_DATA_OBJECT = 0x0015
    RECORD_OUTPUT_DATA_OBJECT = 0x0016
    AR_DATA = 0x0018
    LOG_DATA = 0x0019
    API_DATA = 0x001A
    IM0 = 0x0020
    IM1 = 0x0021
    IM2 = 0x0022
    IM3 = 0x0023
    IM4 = 0x0024
    IM0_FILTER_DATA_SUBMODULE = 0x0030
    IM0_FILTER_DATA_MODULE = 0x0031
    IM0_FILTER_DATA_DEVICE = 0x0032
    CONTAINER_CONTENT = 0x0401
    AR_REQ = 0x0101
    IOCR_REQ = 0x0102
    ALARM_CR_REQ = 0x0103
    EXPECTED_SUBMODULE_REQ = 0x0104
    PRM_SERVER_REQ = 0x0105
    MCR_REQ = 0x0106
    AR_RPC_REQ = 0x0107
    AR_VENDOR_REQ = 0x0108
    IR_INFO_REQ = 0x0109
    SR_INFO_REQ = 0x010A
    AR_FSU_REQ = 0x010B
    RS_INFO_REQ = 0x010C
    PRM_END_REQ = 0x0110
    PRM_END_PLUG_REQ = 0x0111
    APPLICATION_READY_REQ = 0x0112
    APPLICATION_READY_PLUG_REQ = 0x0113
    RELEASE_REQ = 0x0114
    READY_FOR_COMPANION_REQ = 0x0116
    READY_FOR_RT_CLASS_3_REQ = 0x0117
    PRM_BEGIN_REQ = 0x0118
    SUBMODULE_LIST = 0x0119
    AR_FSU_DATA_ADJUST = 0x0609
    MAINTENANCE_ITEM = 0x0F00
    IOD_WRITE_RES = 0x8008
    IOD_READ_RES = 0x8009
    AR_RES = 0x8101
    IOCR_RES = 0x8102
    ALARM_CR_RES = 0x8103
    MODULE_DIFF = 0x8104
    PRM_SERVER_RES = 0x8105
    AR_SERVER_RES = 0x8106
    AR_RPC_RES = 0x8107
    AR_VENDOR_RES = 0x8108
    PRM_END_RES = 0x8110
    PRM_END_PLUG_RES = 0x8111
    APPLICATION_READY_RES = 0x8112
    APPLICATION_READY_PLUG_RES = 0x8113
    RELEASE_RES = 0x8114
    READY_FOR_COMPANION_RES = 0x8116
    READY_FOR_RT_CLASS_3_RES = 0x8117
    PRM_BEGIN_RES = 0x8118


#: Padding before a field, up to four octets from the block's header on.
ALIGNED = Align(4, BLOCK_HEADER_SIZE)


class Block(Structure):
    """A block: of a type with a codec, its fields those of the body, or a :class:`RawBlock`.

    ``types``: the block types of this layout; ``padded``: with padding up to four octets at the end; ``inner``: stands
    inside of other blocks only.  Fields ``block_type`` and ``version`` are those of the header.
    """

    TYPES: ClassVar[tuple[int, ...]] = ()
    #: By block type, for :mod:`pnfarm.protocols.profinet.wire.any_block`.
    KINDS: ClassVar[dict[int, type["Block"]]] = {}
    _padded: ClassVar[bool] = False
    _header: ClassVar[set[str]] = set()

    def __init_subclass__(
        cls, *, types: int | Iterable[int] = (), padded: bool = False, inner: bool = False, **more: Any
    ) -> None:
        super().__init_subclass__(**more)
        cls.TYPES = (types,) if isinstance(types, int) else tuple(types)
        cls._padded = padded
        cls._header = {one.name for one in fields(cls)} & {"block_type", "version"}
        if not inner:
            cls.KINDS.update(dict.fromkeys(cls.TYPES, cls))

    @classmethod
    def of(cls, block: "RawBlock") -> Self:
        """From a block, which must have one of the types of this layout.  Raises :class:`DecodeError`."""
        if block.block_type not in cls.TYPES:
            raise DecodeError("bad-type", f"block 0x{block.block_type:04X} where 0x{cls.TYPES[0]:04X} is expected")
        r = Reader(block.body)
        value = cls.read_body(r, block)
        if cls._padded:
            expect_padding(r)
        else:
            r.expect_end()
        return value

    @classmethod
    def read_body(cls, r: Reader, block: "RawBlock") -> Self:
        """What the body has in it; the end is checked afterwards."""
        return super().read(r, **{name: getattr(block, name) for name in cls._header})

    @classmethod
    def read(cls, r: Reader, **_outside: Any) -> Self:
        return cls.of(RawBlock.read(r))

    @property
    def kind(self) -> int:
        """The block type."""
        kind: int = vars(self).get("block_type", self.TYPES[0])
        return kind

    def write_body(self, w: Writer) -> None:
        super().write(w)

    def write(self, w: Writer) -> None:
        body = Writer()
        self.write_body(body)
        if self._padded:
            ALIGNED.write(body, {})
        RawBlock(self.kind, body.getvalue(), getattr(self, "version", VERSION_1_0)).write(w)


class RawBlock(Block):
    """A block as on the wire; ``body`` is what follows the six octets of its header."""

    block_type: UInt16
    body: Rest
    version: UInt16 = VERSION_1_0

    @property
    def length(self) -> int:
        """BlockLength: the body and the two octets of the version."""
        return len(self.body) + 2

    @property
    def version_high(self) -> int:
        return self.version >> 8

    @property
    def version_low(self) -> int:
        return self.version & 0xFF

    @classmethod
    def read(cls, r: Reader, **_outside: Any) -> Self:
        """The next block.  Raises :class:`DecodeError` (``short``, ``bad-length``)."""
        block_type, length = r.u16(), r.u16()
        if length < 2:
            raise DecodeError("bad-length", f"block 0x{block_type:04X} claims a length of {length}")
        version = r.u16()
        return cls(block_type, r.bytes(length - 2), version)

    def write(self, w: Writer) -> None:
        w.u16(self.block_type).u16(self.length).u16(self.version).bytes(self.body)


class Blocks(Codec):
    """Blocks up to the end: of one of these kinds, else as they are; ``align``: each with padding after it."""

    def __init__(self, *kinds: type[Block], align: Align | None = None) -> None:
        self._kinds = {block_type: kind for kind in kinds for block_type in kind.TYPES}
        self._align = align

    def read(self, r: Reader, _values: Mapping[str, Any]) -> tuple[Block, ...]:
        blocks: list[Block] = []
        while r.remaining:
            raw = RawBlock.read(r)
            blocks.append(self._kinds[raw.block_type].of(raw) if raw.block_type in self._kinds else raw)
            if self._align:
                self._align.read(r, {})
        return tuple(blocks)

    def write(self, w: Writer, value: Iterable[Block]) -> None:
        for block in value:
            block.write(w)
            if self._align:
                self._align.write(w, {})


def split_blocks(data: bytes) -> tuple[RawBlock, ...]:
    """Cut ``data`` into blocks; they follow each other without padding, up to the last octet."""
    r = Reader(data)
    blocks = []
    while r.remaining:
        blocks.append(RawBlock.read(r))
    return tuple(blocks)


def expect_padding(reader: Reader) -> None:
    """Skip what is left, padding to four octets, of any value: some devices do not clear it.

    Raises ``trailing`` where more is left than padding can be.
    """
    if reader.remaining > 3:
        raise DecodeError("trailing", f"{reader.remaining} octets after the end, padding has at most 3")
    reader.skip(reader.remaining)
