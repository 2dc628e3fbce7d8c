"""The record of each index: one table for reading, writing and refusing (IEC 61158-6-10, field Index).

A row gives the record's scope (:class:`Scope`: which of API, slot and subslot count), the allowed accesses and by
which ARs (:class:`Access`), and the part of the device that answers (:class:`Part`).  An index without a row is
invalid, unless the device's own file names it (``OWN``).  Left out on purpose, because this device does not have them:
AutoConfiguration, PROFIenergy, the reporting system, asset management, GSD upload, TSN, isochronous mode.

Two rows are in the profiles' range and belong to the physical device: 0xB050 (control of the external PLL) and 0xB060
(trace unit) of Siemens' Ethernet device driver, as Wireshark names them.  Siemens controllers write them to the
interface and the ports of devices at start-up, RT alone included, and captured devices answer OK.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, Flag, auto

__all__ = ["ISOCHRONOUS", "OWN", "Access", "Index", "Part", "Record", "Scope", "find_record"]


class Index:
    """Record indexes."""

    USER_LAST = 0x7FFF
    COMBINED_OBJECT_CONTAINER = 0x80B0
    EXPECTED_IDENTIFICATION_SUBSLOT = 0x8000
    REAL_IDENTIFICATION_SUBSLOT = 0x8001
    SUBSTITUTE_VALUE = 0x801E
    RECORD_INPUT_DATA = 0x8028
    RECORD_OUTPUT_DATA = 0x8029
    PORT_DATA_REAL = 0x802A
    PORT_DATA_CHECK = 0x802B
    PORT_DATA_ADJUST = 0x802F
    INTERFACE_MRP_DATA_CHECK = 0x8051
    INTERFACE_MRP_DATA_ADJUST = 0x8052
    PORT_MRP_DATA_ADJUST = 0x8053
    NC_DATA_CHECK = 0x8070
    INTERFACE_ADJUST = 0x8071
    PORT_STATISTIC = 0x8072
    INTERFACE_DATA_REAL = 0x8080
    INTERFACE_FSU_DATA_ADJUST = 0x8090
    IM0 = 0xAFF0
    IM1 = 0xAFF1
    IM4 = 0xAFF4
    PROFILE_FIRST = 0xB000
    PLL_CONTROL = 0xB050
    TRACE_UNIT = 0xB060
    PROFILE_LAST = 0xBFFF
    EXPECTED_IDENTIFICATION_SLOT = 0xC000
    REAL_IDENTIFICATION_SLOT = 0xC001
    EXPECTED_IDENTIFICATION_AR = 0xE000
    REAL_IDENTIFICATION_AR = 0xE001
    MODULE_DIFF = 0xE002
    AR_FSU_DATA_ADJUST = 0xE050
    REAL_IDENTIFICATION_API = 0xF000
    AR_DATA_API = 0xF020
    DIAGNOSIS_DEVICE = 0xF80C
    AR_DATA = 0xF820
    API_DATA = 0xF821
    LOG_DATA = 0xF830
    PDEV_DATA = 0xF831
    IM0_FILTER_DATA = 0xF840
    PD_REAL_DATA = 0xF841
    PD_EXPECTED_DATA = 0xF842
    CONNECTION_MONITORING = 0xFBFF


#: What a controller writes for isochronous operation: PDIRSubframeData, PDIRData, PDSyncData, and IsochronousModeData,
#: which no row has.
ISOCHRONOUS = frozenset({0x8020, 0x802C, 0x802D, 0x8030})


class Scope(Enum):
    """What a record is about."""

    SUBSLOT = auto()
    SLOT = auto()
    AR = auto()
    API = auto()
    DEVICE = auto()


class Access(Flag):
    """``WRITE`` is for the AR that owns the submodule.

    ``WRITE_SHARED`` lets a device access AR write as well, where no controller owns the submodule; ``WRITE_ACCESS``
    lets it write always: parameter channels are there for engineering tools, too.
    """

    READ = auto()
    WRITE = auto()
    WRITE_SHARED = auto()
    WRITE_ACCESS = auto()
    ANY_WRITE = WRITE | WRITE_SHARED | WRITE_ACCESS


class Part(Enum):
    """The part of the device that answers."""

    APPLICATION = auto()
    IDENTIFICATION = auto()
    DIAGNOSIS = auto()
    IM = auto()
    IO_DATA = auto()
    AR_DATA = auto()
    LOG_BOOK = auto()
    PDEV = auto()
    MONITORING = auto()
    CONTAINER = auto()
    FAST_STARTUP = auto()


@dataclass(frozen=True, slots=True)
class Record:
    """One row of the table."""

    name: str
    scope: Scope
    access: Access
    part: Part


_R, _RW = Access.READ, Access.READ | Access.WRITE
_SUB, _SLOT, _AR, _API, _DEV = Scope.SUBSLOT, Scope.SLOT, Scope.AR, Scope.API, Scope.DEVICE

_DIAGNOSIS = {
    0x0A: "diagnosis in channel coding",
    0x0B: "diagnosis in all codings",
    0x0C: "diagnosis, maintenance, qualified and status",
    0x10: "maintenance required in channel coding",
    0x11: "maintenance demanded in channel coding",
    0x12: "maintenance required in all codings",
    0x13: "maintenance demanded in all codings",
}
_DIAGNOSIS_SCOPES = {0x8000: _SUB, 0xC000: _SLOT, 0xE000: _AR, 0xF000: _API}

#: Records of the physical device, of its interface and ports; those with True can be written.
_PDEV = {
    0x8020: ("PDIRSubframeData", True),
    0x8027: ("PDPortDataRealExtended", False),
    0x802A: ("PDPortDataReal", False),
    0x802B: ("PDPortDataCheck", True),
    0x802C: ("PDIRData", True),
    0x802D: ("PDSyncData", True),
    0x802F: ("PDPortDataAdjust", True),
    0x8031: ("PDTimeData", True),
    0x8050: ("PDInterfaceMrpDataReal", False),
    0x8051: ("PDInterfaceMrpDataCheck", True),
    0x8052: ("PDInterfaceMrpDataAdjust", True),
    0x8053: ("PDPortMrpDataAdjust", True),
    0x8054: ("PDPortMrpDataReal", False),
    0x8055: ("PDPortMrpIcDataAdjust", True),
    0x8056: ("PDPortMrpIcDataCheck", True),
    0x8057: ("PDPortMrpIcDataReal", False),
    0x8060: ("PDPortFODataReal", False),
    0x8061: ("PDPortFODataCheck", True),
    0x8062: ("PDPortFODataAdjust", True),
    0x8063: ("PDPortSFPDataCheck", True),
    0x8070: ("PDNCDataCheck", True),
    0x8071: ("PDInterfaceAdjust", True),
    0x8072: ("PDPortStatistic", False),
    0x8080: ("PDInterfaceDataReal", False),
    0x8090: ("PDInterfaceFSUDataAdjust", True),
    0xB050: ("control of the external PLL", True),
    0xB060: ("trace unit", True),
}

_RECORDS: dict[int, Record] = {
    Index.EXPECTED_IDENTIFICATION_SUBSLOT: Record("expected identification", _SUB, _R, Part.IDENTIFICATION),
    Index.REAL_IDENTIFICATION_SUBSLOT: Record("real identification", _SUB, _R, Part.IDENTIFICATION),
    Index.EXPECTED_IDENTIFICATION_SLOT: Record("expected identification", _SLOT, _R, Part.IDENTIFICATION),
    Index.REAL_IDENTIFICATION_SLOT: Record("real identification", _SLOT, _R, Part.IDENTIFICATION),
    Index.EXPECTED_IDENTIFICATION_AR: Record("expected identification", _AR, _R, Part.IDENTIFICATION),
    Index.REAL_IDENTIFICATION_AR: Record("real identification", _AR, _R, Part.IDENTIFICATION),
    Index.REAL_IDENTIFICATION_API: Record("real identification", _API, _R, Part.IDENTIFICATION),
    Index.MODULE_DIFF: Record("module difference", _AR, _R, Part.AR_DATA),
    Index.AR_FSU_DATA_ADJUST: Record("ARFSUDataAdjust", _AR, _RW, Part.FAST_STARTUP),
    Index.COMBINED_OBJECT_CONTAINER: Record("CombinedObjectContainer", _SUB, Access.WRITE, Part.CONTAINER),
    Index.AR_DATA_API: Record("ARData", _API, _R, Part.AR_DATA),
    Index.AR_DATA: Record("ARData", _DEV, _R, Part.AR_DATA),
    Index.API_DATA: Record("APIData", _DEV, _R, Part.AR_DATA),
    Index.LOG_DATA: Record("LogData", _DEV, _R, Part.LOG_BOOK),
    Index.CONNECTION_MONITORING: Record("trigger of connection monitoring", _DEV, _R, Part.MONITORING),
    Index.SUBSTITUTE_VALUE: Record("SubstituteValue", _SUB, _RW, Part.IO_DATA),
    Index.RECORD_INPUT_DATA: Record("input data", _SUB, _R, Part.IO_DATA),
    Index.RECORD_OUTPUT_DATA: Record("output data", _SUB, _R, Part.IO_DATA),
    Index.IM0: Record("I&M0", _SUB, _R, Part.IM),
    **{
        index: Record(f"I&M{index - Index.IM0}", _SUB, _R | Access.WRITE_SHARED, Part.IM)
        for index in range(Index.IM1, Index.IM4 + 1)
    },
    Index.IM0_FILTER_DATA: Record("I&M0FilterData", _DEV, _R, Part.IM),
    **{
        first | number: Record(name, scope, _R, Part.DIAGNOSIS)
        for first, scope in _DIAGNOSIS_SCOPES.items()
        for number, name in _DIAGNOSIS.items()
    },
    Index.DIAGNOSIS_DEVICE: Record(_DIAGNOSIS[0x0C], _DEV, _R, Part.DIAGNOSIS),
    **{i: Record(name, _SUB, _RW if writable else _R, Part.PDEV) for i, (name, writable) in _PDEV.items()},
    Index.PDEV_DATA: Record("PDevData", _DEV, _R, Part.PDEV),
    Index.PD_REAL_DATA: Record("PDRealData", _DEV, _R, Part.PDEV),
    Index.PD_EXPECTED_DATA: Record("PDExpectedData", _DEV, _R, Part.PDEV),
}

_USER = Record("the application's", _SUB, _R | Access.WRITE_ACCESS, Part.APPLICATION)
_PROFILE = Record("the profile's", _SUB, _R | Access.WRITE_ACCESS, Part.APPLICATION)
#: Of an index without a row that a maker's file names: 0xE030 of SIMATIC ET 200S High Speed.
OWN = Record("the maker's", _SUB, _R | Access.WRITE_ACCESS, Part.APPLICATION)


def find_record(index: int) -> Record | None:
    """The row of ``index``, or None for an unknown index."""
    found = _RECORDS.get(index)
    if found is not None:
        return found
    if index <= Index.USER_LAST:
        return _USER
    if Index.PROFILE_FIRST <= index <= Index.PROFILE_LAST:
        return _PROFILE
    return None
