"""IOCRBlockReq and IOCRBlockRes: one cyclic channel and where each datum lies in its frame
(IEC 61158-6-10, IODConnectReq)."""

from enum import IntEnum

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, BlockType
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET
from pnfarm.wire.layout import List16, Mac, Outside, Structure, UInt16, UInt32

__all__ = [
    "ETHERTYPE_PROFINET",
    "FRAME_ID_ASSIGN",
    "FRAME_SEND_OFFSET_ANY",
    "IOCR_TAG_HEADER",
    "MAX_C_SDU",
    "MIN_C_SDU",
    "RT_CLASS_MASK",
    "FrameSlot",
    "IocrApi",
    "IocrBlockReq",
    "IocrBlockRes",
    "IocrType",
    "RtClass",
]

#: FrameID of an output CR in a request: the device is to choose.
FRAME_ID_ASSIGN = 0xFFFF
#: FrameSendOffset: best effort.
FRAME_SEND_OFFSET_ANY = 0xFFFFFFFF
#: IOCRTagHeader: user priority 6 << 13 | VLAN identifier 0.
IOCR_TAG_HEADER = 0xC000
MULTICAST_MAC_NONE = bytes(6)
#: IOCRProperties: :class:`RtClass`.
RT_CLASS_MASK = 0x0F
#: Octets of IO data that one frame of RT class 1 or 2 carries, from and to (IEC 61158-6-10, C_SDU).
MIN_C_SDU = 40
MAX_C_SDU = 1440


class IocrType(IntEnum):
    """Coding of the field IOCRType."""

    INPUT = 1
    OUTPUT = 2
    MULTICAST_PROVIDER = 3
    MULTICAST_CONSUMER = 4


class RtClass(IntEnum):
    """IOCRProperties.RTClass, bits 0 to 3.

    The standard renamed the classes: what legacy start-up calls class 1 (frame ids from 0xC000) and
    class 2 (from 0x8000) are both unsynchronised; advanced start-up allows class 2 and up only.
    """

    CLASS_1 = 1
    CLASS_2 = 2
    CLASS_3 = 3
    UDP = 4


class FrameSlot(Structure):
    """An IODataObject or an IOCS: ``frame_offset`` counts octets from the start of the C_SDU."""

    slot: UInt16
    subslot: UInt16
    frame_offset: UInt16


class IocrApi(Structure):
    api: UInt32
    data_objects: List16[FrameSlot] = ()
    iocs: List16[FrameSlot] = ()


class IocrBlockReq(
    Block,
    types=BlockType.IOCR_REQ,
    wire="iocr_type iocr_reference lt properties data_length frame_id send_clock_factor reduction_ratio phase sequence "
    "frame_send_offset watchdog_factor data_hold_factor tag_header multicast_mac apis",
):
    """0x0102.  ``send_clock_factor`` counts 31.25 us; ``data_length`` is the C_SDU's, in octets."""

    iocr_type: UInt16
    iocr_reference: UInt16
    properties: UInt32
    data_length: UInt16
    frame_id: UInt16
    send_clock_factor: UInt16
    reduction_ratio: UInt16
    apis: List16[IocrApi]
    phase: UInt16 = 1
    sequence: UInt16 = 0
    frame_send_offset: UInt32 = FRAME_SEND_OFFSET_ANY
    watchdog_factor: UInt16 = 3
    data_hold_factor: UInt16 = 3
    lt: UInt16 = ETHERTYPE_PROFINET
    tag_header: UInt16 = IOCR_TAG_HEADER
    multicast_mac: Mac = MULTICAST_MAC_NONE
    version: Outside[int] = VERSION_1_0

    @property
    def rt_class(self) -> int:
        return self.properties & RT_CLASS_MASK


class IocrBlockRes(Block, types=BlockType.IOCR_RES):
    """0x8102: the frame id that the CR really has."""

    iocr_type: UInt16
    iocr_reference: UInt16
    frame_id: UInt16
    version: Outside[int] = VERSION_1_0
