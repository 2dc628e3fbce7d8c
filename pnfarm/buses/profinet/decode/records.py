"""Records as text: names of indexes."""

from __future__ import annotations

from pnfarm.buses.profinet.decode.channels import PROFIDRIVE_API

__all__ = ["index_text", "is_parameter_access"]

#: Base mode parameter access: the profile's two record numbers, and 47 of DP-V1 and of several drives, which elsewhere
#: is a record like any other.
_BASE_MODE_INDEXES = frozenset({0xB02E, 0xB02F})
_DATA_AREA = 47
#: IEC 61158-6-10, coding of the field Index.
_INDEXES = {
    0x8000: "expected identification of the subslot", 0x8001: "real identification of the subslot",
    0x800A: "channel diagnosis of the subslot", 0x800C: "diagnosis of the subslot",
    0x8020: "PDIRSubframeData", 0x8028: "RecordInputData", 0x8029: "RecordOutputData", 0x802A: "PDPortDataReal",
    0x802B: "PDPortDataCheck", 0x802C: "PDIRData", 0x802D: "PDSyncData", 0x802F: "PDPortDataAdjust",
    0x8051: "PDInterfaceMrpDataCheck", 0x8052: "PDInterfaceMrpDataAdjust", 0x8053: "PDPortMrpDataAdjust",
    0x8070: "PDNCDataCheck", 0x8071: "PDInterfaceAdjust", 0x8072: "PDPortStatistic", 0x8080: "PDInterfaceDataReal",
    0x8090: "PDInterfaceFSUDataAdjust", 0x80B0: "CombinedObjectContainer",
    0xAFF0: "I&M0", 0xAFF1: "I&M1", 0xAFF2: "I&M2", 0xAFF3: "I&M3", 0xAFF4: "I&M4",
    0xC000: "expected identification of the slot", 0xC001: "real identification of the slot",
    0xE000: "expected identification of the AR", 0xE001: "real identification of the AR", 0xE002: "ModuleDiffBlock",
    0xE00C: "diagnosis of the AR", 0xE040: "multiple write", 0xE050: "ARFSUDataAdjust",
    0xB050: "external PLL (Siemens)", 0xB060: "trace unit (Siemens)",
    0xF000: "real identification of the API", 0xF80C: "diagnosis of the device", 0xF820: "ARData", 0xF821: "APIData",
    0xF830: "LogBookData", 0xF831: "PDevData", 0xF840: "I&M0FilterData", 0xF841: "PDRealData", 0xF842: "PDExpectedData",
}  # fmt: skip


def is_parameter_access(api: int, index: int, *, drive: bool = False) -> bool:
    """Whether a record is PROFIdrive's parameter access; ``drive``: of a station that is known to be one."""
    return index in _BASE_MODE_INDEXES or (index == _DATA_AREA and (drive or api == PROFIDRIVE_API))


def index_text(api: int, index: int) -> str:
    """``0xAFF0 (I&M0)``."""
    if is_parameter_access(api, index):
        return f"0x{index:04X} (parameter access)"
    name = _INDEXES.get(index)
    return f"0x{index:04X} ({name})" if name else f"0x{index:04X}"
