"""What the controller expects and how the device differs: ExpectedSubmoduleBlockReq, ModuleDiffBlock
(IEC 61158-6-10)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, RawBlock, check_type, emit_raw_block
from pnfarm.wire.octets import Reader, Writer

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
    "emit_expected_submodule_block_req",
    "emit_module_diff_block",
    "parse_expected_submodule_block_req",
    "parse_module_diff_block",
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


@dataclass(frozen=True, slots=True)
class DataDescription:
    """One direction of a submodule; lengths in octets."""

    direction: int
    data_length: int
    iocs_length: int = 1
    iops_length: int = 1


@dataclass(frozen=True, slots=True)
class ExpectedSubmodule:
    subslot: int
    submodule_ident: int
    properties: int
    data: tuple[DataDescription, ...]

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


@dataclass(frozen=True, slots=True)
class ExpectedApi:
    """One slot of one API, as the block counts it ("NumberOfAPIs" counts these)."""

    api: int
    slot: int
    module_ident: int
    submodules: tuple[ExpectedSubmodule, ...]
    module_properties: int = 0


@dataclass(frozen=True, slots=True)
class ExpectedSubmoduleBlockReq:
    """0x0104; a Connect request holds one or many."""

    apis: tuple[ExpectedApi, ...]
    version: int = VERSION_1_0


def _read_submodule(r: Reader) -> ExpectedSubmodule:
    subslot, ident, properties = r.u16(), r.u32(), r.u16()
    # input and output in one submodule bring two descriptions, everything else (no data, too) one
    count = 2 if properties & SubmoduleProperties.TYPE_MASK == SubmoduleType.INPUT_OUTPUT else 1
    data = tuple(DataDescription(r.u16(), r.u16(), r.u8(), r.u8()) for _ in range(count))
    return ExpectedSubmodule(subslot, ident, properties, data)


def parse_expected_submodule_block_req(block: RawBlock) -> ExpectedSubmoduleBlockReq:
    r = check_type(block, BlockType.EXPECTED_SUBMODULE_REQ)
    apis = []
    for _ in range(r.u16()):
        api, slot, ident, properties, count = r.u32(), r.u16(), r.u32(), r.u16(), r.u16()
        apis.append(ExpectedApi(api, slot, ident, tuple(_read_submodule(r) for _ in range(count)), properties))
    r.expect_end()
    return ExpectedSubmoduleBlockReq(tuple(apis), block.version)


def emit_expected_submodule_block_req(value: ExpectedSubmoduleBlockReq) -> bytes:
    w = Writer().u16(len(value.apis))
    for api in value.apis:
        w.u32(api.api).u16(api.slot).u32(api.module_ident).u16(api.module_properties).u16(len(api.submodules))
        for sub in api.submodules:
            w.u16(sub.subslot).u32(sub.submodule_ident).u16(sub.properties)
            for data in sub.data:
                w.u16(data.direction).u16(data.data_length).u8(data.iocs_length).u8(data.iops_length)
    return emit_raw_block(RawBlock(BlockType.EXPECTED_SUBMODULE_REQ, w.getvalue(), value.version))


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
    maintenance_demanded: bool = False,
    maintenance_required: bool = False,
    qualified: bool = False,
    takeover_denied: bool = False,
) -> int:
    """SubmoduleState (u16) with FormatIndicator 1.  ``takeover_denied`` is AddInfo 1, for a supervisor."""
    return (
        0x8000
        | (ident_info & 0xF) << 11
        | (ar_info & 0xF) << 7
        | fault << 6
        | maintenance_demanded << 5
        | maintenance_required << 4
        | qualified << 3
        | takeover_denied
    )


@dataclass(frozen=True, slots=True)
class DiffSubmodule:
    """``submodule_ident`` is the real one."""

    subslot: int
    submodule_ident: int
    state: int

    @property
    def ident_info(self) -> int:
        return self.state >> 11 & 0xF

    @property
    def ar_info(self) -> int:
        return self.state >> 7 & 0xF


@dataclass(frozen=True, slots=True)
class DiffModule:
    """``module_ident`` is the real one, 0 where the slot is empty."""

    slot: int
    module_ident: int
    state: int
    submodules: tuple[DiffSubmodule, ...] = ()


@dataclass(frozen=True, slots=True)
class DiffApi:
    api: int
    modules: tuple[DiffModule, ...]


@dataclass(frozen=True, slots=True)
class ModuleDiffBlock:
    """0x8104: sent only when something differs."""

    apis: tuple[DiffApi, ...]
    version: int = VERSION_1_0


def _read_diff_module(r: Reader) -> DiffModule:
    slot, ident, state, count = r.u16(), r.u32(), r.u16(), r.u16()
    return DiffModule(slot, ident, state, tuple(DiffSubmodule(r.u16(), r.u32(), r.u16()) for _ in range(count)))


def parse_module_diff_block(block: RawBlock) -> ModuleDiffBlock:
    r = check_type(block, BlockType.MODULE_DIFF)
    apis = []
    for _ in range(r.u16()):
        api, count = r.u32(), r.u16()
        apis.append(DiffApi(api, tuple(_read_diff_module(r) for _ in range(count))))
    r.expect_end()
    return ModuleDiffBlock(tuple(apis), block.version)


def emit_module_diff_block(value: ModuleDiffBlock) -> bytes:
    w = Writer().u16(len(value.apis))
    for api in value.apis:
        w.u32(api.api).u16(len(api.modules))
        for module in api.modules:
            w.u16(module.slot).u32(module.module_ident).u16(module.state).u16(len(module.submodules))
            for sub in module.submodules:
                w.u16(sub.subslot).u32(sub.submodule_ident).u16(sub.state)
    return emit_raw_block(RawBlock(BlockType.MODULE_DIFF, w.getvalue(), value.version))
