"""Control blocks: the end of parametrisation, application ready, release and the like
(IEC 61158-6-10, IODControlReq, IOXControlReq, IODReleaseReq).  One shape for all of them."""

from pnfarm.protocols.profinet.wire.block import RESPONSE, VERSION_1_0, Block, BlockType
from pnfarm.wire.layout import List16, Outside, UInt16, UInt32, Uuid

__all__ = ["CONTROL_BLOCK_TYPES", "ControlBlock", "ControlCommand", "SubmoduleList", "control_response"]

CONTROL_BLOCK_TYPES = tuple(
    code | bit
    for bit in (0, RESPONSE)
    for code in (
        BlockType.PRM_END_REQ,
        BlockType.PRM_END_PLUG_REQ,
        BlockType.APPLICATION_READY_REQ,
        BlockType.APPLICATION_READY_PLUG_REQ,
        BlockType.RELEASE_REQ,
        BlockType.READY_FOR_COMPANION_REQ,
        BlockType.READY_FOR_RT_CLASS_3_REQ,
        BlockType.PRM_BEGIN_REQ,
    )
)


class ControlCommand:
    """Bits of the field ControlCommand (u16); a block sets exactly one."""

    PRM_END = 1 << 0
    APPLICATION_READY = 1 << 1
    RELEASE = 1 << 2
    DONE = 1 << 3
    READY_FOR_COMPANION = 1 << 4
    READY_FOR_RT_CLASS_3 = 1 << 5
    PRM_BEGIN = 1 << 6


class ControlBlock(
    Block,
    types=CONTROL_BLOCK_TYPES,
    wire="padding ar_uuid session_key alarm_sequence_number command properties",
):
    """0x0110 - 0x0118 and their responses.

    ``alarm_sequence_number`` is used by the two plug blocks and is reserved in the others.
    """

    block_type: Outside[int]
    ar_uuid: Uuid
    session_key: UInt16
    command: UInt16
    alarm_sequence_number: UInt16 = 0
    properties: UInt16 = 0
    padding: UInt16 = 0
    version: Outside[int] = VERSION_1_0


def control_response(request: ControlBlock) -> ControlBlock:
    """The positive answer to ``request``: the same AR and session, command Done."""
    return ControlBlock(
        request.block_type | RESPONSE,
        request.ar_uuid,
        request.session_key,
        ControlCommand.DONE,
        request.alarm_sequence_number,
    )


class SubmoduleList(Block, types=BlockType.SUBMODULE_LIST):
    """0x0119: the submodules, each (api, slot, subslot), that a PrmBegin is about."""

    entries: List16[tuple[UInt32, UInt16, UInt16]]
    version: Outside[int] = VERSION_1_0
