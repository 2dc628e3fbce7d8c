"""What the controller expects and how the device differs: ExpectedSubmoduleBlockReq, ModuleDiffBlock
(IEC 61158-6-10)."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Annotated, Any

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, BlockType
from pnfarm.wire.layout import Count, List16, Outside, Structure, UInt8, UInt16, UInt32

__all__ = [
    "ArInfo",
    "DataDescription",
    "DataDirection",
    "DiffApi",
    "DiffModule",
    "DiffSubmodule",
    "ExpectedApi",
    "ExpectedSubmodule",
    "ExpectedSubmoduleBlockReq",
    "IdentInfo",
    "ModuleDiffBlock",
    "ModuleState",
    "SubmoduleProperties",
    "SubmoduleType",
    "submodule_state",
]


class SubmoduleType(IntEnum):
    """SubmoduleProperties.Type, bits 0 and 1."""

    NO_IO = 0
    INPUT = 1
    OUTPUT = 2
    INPUT_OUTPUT = 3


class SubmoduleProperties:
    """Bits of the field SubmoduleProperties (u16)."""

    TYPE_MASK = 0x0003
    SHARED_INPUT = 1 << 2
    REDUCE_INPUT_LENGTH = 1 << 3
    REDUCE_OUTPUT_LENGTH = 1 << 4
    DISCARD_IOXS = 1 << 5


class DataDirection(IntEnum):
    """DataDescription.Type."""

    INPUT = 1
    OUTPUT = 2


class DataDescription(Structure):
    """One direction of a submodule; lengths in octets."""

    direction: UInt16
    data_length: UInt16
    iocs_length: UInt8 = 1
    iops_length: UInt8 = 1


def _descriptions(values: Mapping[str, Any]) -> int:
    """Input and output in one submodule bring two descriptions, everything else (no data, too) one."""
    return 2 if values["properties"] & SubmoduleProperties.TYPE_MASK == SubmoduleType.INPUT_OUTPUT else 1


class ExpectedSubmodule(Structure):
    subslot: UInt16
    submodule_ident: UInt32
    properties: UInt16
    data: Annotated[tuple[DataDescription, ...], Count(_descriptions)]

    @property
    def type(self) -> int:
        return self.properties & SubmoduleProperties.TYPE_MASK

    @property
    def discards_ioxs(self) -> bool:
        """Its provider and consumer status occupy no octet of any frame, whatever their lengths."""
        return bool(self.properties & SubmoduleProperties.DISCARD_IOXS)

    def length(self, direction: int) -> int:
        """Data octets in ``direction``; 0 when the submodule has none."""
        return sum(d.data_length for d in self.data if d.direction == direction)


class ExpectedApi(Structure, wire="api slot module_ident module_properties submodules"):
    """One slot of one API, as the block counts it ("NumberOfAPIs" counts these)."""

    api: UInt32
    slot: UInt16
    module_ident: UInt32
    submodules: List16[ExpectedSubmodule]
    module_properties: UInt16 = 0


class ExpectedSubmoduleBlockReq(Block, types=BlockType.EXPECTED_SUBMODULE_REQ):
    """0x0104; a Connect request holds one or many."""

    apis: List16[ExpectedApi]
    version: Outside[int] = VERSION_1_0


class ModuleState(IntEnum):
    """Coding of the field ModuleState."""

    NO_MODULE = 0
    WRONG_MODULE = 1
    PROPER_MODULE = 2
    SUBSTITUTE = 3


class IdentInfo(IntEnum):
    """SubmoduleState.IdentInfo, bits 11 to 14."""

    OK = 0
    SUBSTITUTE = 1
    WRONG = 2
    NO_SUBMODULE = 3


class ArInfo(IntEnum):
    """SubmoduleState.ARInfo, bits 7 to 10."""

    OWN = 0
    APPLICATION_READY_PENDING = 1
    SUPERORDINATED_LOCKED = 2
    LOCKED_BY_IO_CONTROLLER = 3
    LOCKED_BY_IO_SUPERVISOR = 4


def submodule_state(
    ident_info: int = IdentInfo.OK,
    ar_info: int = ArInfo.OWN,
    *,
    fault: bool = False,
    takeover_denied: bool = False,
) -> int:
    """SubmoduleState (u16) with FormatIndicator 1.  ``takeover_denied`` is AddInfo 1, for a supervisor."""
    return 0x8000 | (ident_info & 0xF) << 11 | (ar_info & 0xF) << 7 | fault << 6 | takeover_denied


class DiffSubmodule(Structure):
    """``submodule_ident`` is the real one."""

    subslot: UInt16
    submodule_ident: UInt32
    state: UInt16

    @property
    def ident_info(self) -> int:
        return self.state >> 11 & 0xF

    @property
    def ar_info(self) -> int:
        return self.state >> 7 & 0xF


class DiffModule(Structure):
    """``module_ident`` is the real one, 0 where the slot is empty."""

    slot: UInt16
    module_ident: UInt32
    state: UInt16
    submodules: List16[DiffSubmodule] = ()


class DiffApi(Structure):
    api: UInt32
    modules: List16[DiffModule]


class ModuleDiffBlock(Block, types=BlockType.MODULE_DIFF):
    """0x8104: sent only when something differs."""

    apis: List16[DiffApi]
    version: Outside[int] = VERSION_1_0
