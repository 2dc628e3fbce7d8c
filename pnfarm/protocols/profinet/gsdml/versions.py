"""Which version of the GSDML schema has which attribute, asks for it, or has a default for it.

The reader asks :class:`Attributes` for each attribute, and the attribute's row in :data:`TABLE` says what counts where
a file does not have it: its default.  A file without an attribute that has none, and that is a number or that something
refers to, is refused.  Where the file's version asks for an attribute that a connection can do without, the row says
why it can; then the default counts, and :attr:`Attributes.remarks` says what is missing.  An attribute that only later
versions have counts like any other: makers use them.

Facts: PI's schemas V2.35 and V2.44 (what they require, their defaults, and what they keep for files of older
versions), and sixty files of seventeen makers, V1.0 to V2.44: ``since`` is the first version whose files have the
attribute, or the one that its place in the schema's order suggests, and ``required`` the first one from which on every
file has it, where the schemas require it.  No schema of another version was available (assumed: V2.45, of which the
access points of one file were seen, asks for nothing more).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, NoReturn

from pnfarm.protocols.profinet.gsdml.values import Numbers, parse_number, parse_tokens

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.gsdml.safe_xml import Node

__all__ = ["TABLE", "VERSIONS", "Attributes", "Row", "version_of"]

#: Every version of the schema, in order; they count as decimal numbers do, 2.25 stands between 2.2 and 2.3.
VERSIONS = ("1.0", "2.0", "2.1", "2.2", "2.25", "2.3", "2.31", "2.32", "2.33", "2.34", "2.35", "2.4", "2.41", "2.42",
            "2.43", "2.44", "2.45")  # fmt: skip
_NUMBER = r"([0-9]{1,2}\.[0-9]{1,3})"
_IN_LOCATION = re.compile(rf"GSDML-DeviceProfile-v{_NUMBER}(?:\.[0-9]{{1,3}})?\.xsd", re.IGNORECASE)
_IN_NAME = re.compile(rf"GSDML-v{_NUMBER}-", re.IGNORECASE)

_FLAGS = {"true": True, "1": True, "false": False, "0": False}


def version_of(location: str, file_name: str) -> str:
    """``2.31``: that of the schema which a file's root names, else that of the file's own name, else nothing."""
    found = _IN_LOCATION.search(location) or _IN_NAME.match(file_name)
    return "" if found is None else found[1]


@dataclass(frozen=True, slots=True)
class Row:
    """An attribute: the first version that has it, the first that asks for it (empty: none does), and its default.

    ``lenient``: why a file may lack it although its version asks for it; where it is empty, such a file is refused.
    ``note``: what else is known of it.
    """

    element: str
    attribute: str
    since: str
    required: str = ""
    default: str = ""
    lenient: str = ""
    note: str = ""


# reasons
_UNUSED = "no connection depends on it"
_UNREFERENCED = "nothing refers to it, the subslot says which one it is"
_ONE_INSTANCE = "devices have one instance, and makers number it 1"

# notes
_TIMEOUT = "the schema's default is 300 s; 0 says that the file does not name it"
_ONE_SUBMODULE = "V1.0 has one submodule in each module, in subslot 1 and API 0"
_NO_SYSTEM = "V1.0 has neither interfaces nor ports"
_MOVED = "V1.0 has it at the access point, later versions at its interface"
_SHARED = "V2.35 has no records that several submodules share"

#: Subslots of interfaces begin there.
_INTERFACE = "32768"
_RATIOS = "1 2 4 8 16 32 64 128 256 512"

TABLE = (
    Row("DeviceIdentity", "VendorID", "1.0", "1.0"),
    Row("DeviceIdentity", "DeviceID", "1.0", "1.0"),
    # access points
    Row("DeviceAccessPointItem", "ID", "1.0", "1.0"),
    Row("DeviceAccessPointItem", "ModuleIdentNumber", "1.0", "1.0"),
    Row("DeviceAccessPointItem", "PhysicalSlots", "1.0", "1.0", lenient="the modules' references name their slots"),
    Row("DeviceAccessPointItem", "MinDeviceInterval", "1.0", "1.0"),
    Row("DeviceAccessPointItem", "ImplementationType", "1.0"),
    Row("DeviceAccessPointItem", "DNS_CompatibleName", "1.0", "1.0", lenient=_UNUSED),
    Row("DeviceAccessPointItem", "FixedInSlots", "1.0", "1.0", lenient="its first allowed slot counts, else 0"),
    Row("DeviceAccessPointItem", "AllowedInSlots", "1.0"),
    Row("DeviceAccessPointItem", "ObjectUUID_LocalIndex", "1.0", "1.0", "1", _ONE_INSTANCE),
    Row("DeviceAccessPointItem", "RequiredSchemaVersion", "2.0", "", "V1.0"),
    Row("DeviceAccessPointItem", "MultipleWriteSupported", "2.1", "", "false"),
    Row("DeviceAccessPointItem", "IOXS_Required", "2.1", "", "true"),
    Row("DeviceAccessPointItem", "AddressAssignment", "2.1", "", "DCP"),
    Row("DeviceAccessPointItem", "PhysicalSubslots", "2.1"),
    Row("DeviceAccessPointItem", "RemoteApplicationTimeout", "2.1", "", "0", note=_TIMEOUT),
    Row("DeviceAccessPointItem", "MaxSupportedRecordSize", "2.1", "", "4068"),
    Row("DeviceAccessPointItem", "NameOfStationNotTransferable", "2.25", "2.3", "false", _UNUSED),
    Row("DeviceAccessPointItem", "SharedDeviceSupported", "2.25", "", "false"),
    Row("DeviceAccessPointItem", "SharedInputSupported", "2.25", "", "false"),
    Row("DeviceAccessPointItem", "DeviceAccessSupported", "2.25", "2.25", "false", _UNUSED),
    Row("DeviceAccessPointItem", "NumberOfDeviceAccessAR", "2.25", "", "0"),
    Row("DeviceAccessPointItem", "PNIO_Version", "2.3", "2.3", lenient=_UNUSED),
    Row("DeviceAccessPointItem", "LLDP_NoD_Supported", "2.3", "", "false"),
    Row("DeviceAccessPointItem", "ResetToFactoryModes", "2.3"),
    Row("DeviceAccessPointItem", "CheckDeviceID_Allowed", "2.31", "2.31", "false", _UNUSED),
    Row("IOConfigData", "MaxInputLength", "1.0", "1.0", "0", "the modules' data say how long frames are"),
    Row("IOConfigData", "MaxOutputLength", "1.0", "1.0", "0", "the modules' data say how long frames are"),
    Row("IOConfigData", "MaxDataLength", "1.0", "", "0"),
    Row("CertificationInfo", "ConformanceClass", "2.31"),
    Row("CertificationInfo", "ApplicationClass", "2.31"),
    Row("CertificationInfo", "NetloadClass", "2.31"),
    # modules and their places
    Row("ModuleItem", "ID", "1.0", "1.0"),
    Row("ModuleItem", "ModuleIdentNumber", "1.0", "1.0"),
    Row("ModuleItem", "PhysicalSubslots", "2.1"),
    Row("ModuleItemRef", "ModuleItemTarget", "1.0", "1.0"),
    Row("ModuleItemRef", "AllowedInSlots", "1.0"),
    Row("ModuleItemRef", "UsedInSlots", "1.0"),
    Row("ModuleItemRef", "FixedInSlots", "1.0"),
    Row("SubmoduleItemRef", "SubmoduleItemTarget", "2.1", "2.1"),
    Row("SubmoduleItemRef", "AllowedInSubslots", "2.1"),
    Row("SubmoduleItemRef", "UsedInSubslots", "2.1"),
    Row("SubmoduleItemRef", "FixedInSubslots", "2.1"),
    # submodules with data
    Row("VirtualSubmoduleItem", "ID", "1.0", "1.0", "", _UNREFERENCED),
    Row("VirtualSubmoduleItem", "SubmoduleIdentNumber", "1.0", "1.0"),
    Row("VirtualSubmoduleItem", "API", "2.0", "", "0", note=_ONE_SUBMODULE),
    Row("VirtualSubmoduleItem", "FixedInSubslots", "2.0", "", "1", note=_ONE_SUBMODULE),
    Row("VirtualSubmoduleItem", "PROFIsafeSupported", "2.0", "", "false"),
    Row("VirtualSubmoduleItem", "Writeable_IM_Records", "2.1"),
    Row("VirtualSubmoduleItem", "MayIssueProcessAlarm", "2.32", "2.32", "false", _UNUSED),
    Row("SubmoduleItem", "ID", "2.1", "2.1"),
    Row("SubmoduleItem", "SubmoduleIdentNumber", "2.1", "2.1"),
    Row("SubmoduleItem", "API", "2.1", "", "0"),
    Row("SubmoduleItem", "PROFIsafeSupported", "2.1", "", "false"),
    Row("SubmoduleItem", "Writeable_IM_Records", "2.1"),
    Row("SubmoduleItem", "MayIssueProcessAlarm", "2.32", "2.32", "false", _UNUSED),
    Row("IOData", "IOPS_Length", "1.0", "", "1", note="V2.35 does not have it"),
    Row("IOData", "IOCS_Length", "1.0", "", "1", note="V2.35 does not have it"),
    Row("Input", "Consistency", "1.0", "", "Item consistency"),
    Row("Output", "Consistency", "1.0", "", "Item consistency"),
    Row("DataItem", "DataType", "1.0", "1.0"),
    Row("DataItem", "Length", "1.0", "1.0", note="of types that have no length of their own"),
    Row("DataItem", "UseAsBits", "1.0", "", "false"),
    Row("BitDataItem", "BitOffset", "1.0", "1.0"),
    Row("F_ParameterRecordDataItem", "Index", "2.0", "2.0"),
    Row("F_ParameterRecordDataItem", "TransferSequence", "2.0", "", "0"),
    # interfaces and ports
    Row("InterfaceSubmoduleItem", "ID", "2.25", "2.25", "", _UNREFERENCED),
    Row("InterfaceSubmoduleItem", "SubmoduleIdentNumber", "2.0", "2.0", note=_NO_SYSTEM),
    Row("InterfaceSubmoduleItem", "SubslotNumber", "2.0", "", _INTERFACE),
    Row("InterfaceSubmoduleItem", "SupportedRT_Class", "2.0", "", "Class1"),
    Row("InterfaceSubmoduleItem", "SupportedRT_Classes", "2.1", note="in place of SupportedRT_Class"),
    Row("InterfaceSubmoduleItem", "SupportedProtocols", "2.1", "2.1", "", _UNUSED),
    Row("InterfaceSubmoduleItem", "NetworkComponentDiagnosisSupported", "2.1", "", "false"),
    Row("InterfaceSubmoduleItem", "DCP_HelloSupported", "2.2", "", "false"),
    Row("InterfaceSubmoduleItem", "Writeable_IM_Records", "2.25"),
    Row("InterfaceSubmoduleItem", "PTP_BoundarySupported", "2.3", "", "false"),
    Row("InterfaceSubmoduleItem", "DCP_BoundarySupported", "2.3", "", "false"),
    Row("PortSubmoduleItem", "ID", "2.25", "2.25", "", _UNREFERENCED),
    Row("PortSubmoduleItem", "SubmoduleIdentNumber", "2.0", "2.0", note=_NO_SYSTEM),
    Row("PortSubmoduleItem", "SubslotNumber", "2.0", "2.0"),
    Row("PortSubmoduleItem", "MaxPortRxDelay", "2.0", "", "0"),
    Row("PortSubmoduleItem", "MaxPortTxDelay", "2.0", "", "0"),
    Row("PortSubmoduleItem", "Writeable_IM_Records", "2.25"),
    Row("PortSubmoduleItem", "MAUType", "2.0", "", "100BASETXFD"),
    Row("PortSubmoduleItem", "MAUTypes", "2.3", note="in place of MAUType"),
    Row("MAUTypeItem", "Value", "2.32", "2.32", note="in place of MAUTypes"),
    Row("ApplicationRelations", "NumberOfAdditionalInputCR", "2.1", "", "0"),
    Row("ApplicationRelations", "NumberOfAdditionalOutputCR", "2.1", "", "0"),
    Row("ApplicationRelations", "PullModuleAlarmSupported", "2.2", "", "false"),
    Row("ApplicationRelations", "StartupMode", "2.3", "", "Legacy"),
    Row("ApplicationRelations", "NumberOfAR", "2.3", "", "1"),
    Row("TimingProperties", "SendClock", "1.0", "", "32", note=_MOVED),
    Row("TimingProperties", "ReductionRatio", "1.0", "", _RATIOS, note=_MOVED),
    Row("TimingProperties", "ReductionRatioPow2", "2.3", note="where ReductionRatio is missing"),
    # parameter records
    Row("ParameterRecordDataItem", "Index", "1.0", "1.0"),
    Row("ParameterRecordDataItem", "Length", "1.0", "1.0"),
    Row("ParameterRecordDataItem", "TransferSequence", "1.0", "", "0"),
    Row("ParameterRecordDataItem", "ID", "2.44", "2.44", note=_SHARED),
    Row("ParameterRecordDataRef", "RecordDataTarget", "2.44", "2.44", note=_SHARED),
    Row("ParameterRecordDataRef", "TransferSequence", "2.44", note=_SHARED),
    Row("Const", "ByteOffset", "1.0", "", "0"),
    Row("Const", "Data", "1.0", "1.0", "", "octets without a value are 0"),
    Row("Ref", "DataType", "1.0", "1.0"),
    Row("Ref", "ByteOffset", "1.0", "1.0"),
    Row("Ref", "BitOffset", "1.0", "", "0"),
    Row("Ref", "BitLength", "1.0", "", "1"),
    Row("Ref", "Length", "1.0", "", "0"),
    Row("Ref", "DefaultValue", "1.0", note="octets without a value are 0"),
    Row("Ref", "AllowedValues", "1.0"),
    Row("Ref", "ValueItemTarget", "1.0", note="texts of values"),
    Row("Ref", "Changeable", "1.0", "", "true"),
    Row("Ref", "Visible", "1.0", "", "true"),
    Row("ValueItem", "ID", "1.0", "1.0"),
    Row("Assign", "Content", "1.0", "1.0"),
    # texts of diagnosis
    Row("ChannelDiagItem", "ErrorType", "1.0", "1.0"),
    Row("ProfileChannelDiagItem", "ErrorType", "2.3", "2.3"),
    Row("ProfileChannelDiagItem", "API", "2.3", "2.3"),
    Row("SystemDefinedChannelDiagItem", "ErrorType", "2.2", "2.2"),
    Row("ChannelDiagItem", "MaintenanceAlarmState", "2.25", "", "D"),
    Row("ProfileChannelDiagItem", "MaintenanceAlarmState", "2.3", "", "D"),
    Row("ExtChannelDiagItem", "MaintenanceAlarmState", "2.25", "", "D"),
    Row("ProfileExtChannelDiagItem", "MaintenanceAlarmState", "2.3", "", "D"),
    Row("ExtChannelDiagItem", "ErrorType", "2.2", "2.2"),
    Row("ProfileExtChannelDiagItem", "ErrorType", "2.3", "2.3"),
    Row("UnitDiagTypeItem", "UserStructureIdentifier", "1.0", "1.0"),
    Row("ProfileUnitDiagTypeItem", "UserStructureIdentifier", "2.3", "2.3"),
    Row("ProfileUnitDiagTypeItem", "API", "2.3", "2.3"),
)  # fmt: skip

_ROWS = {(row.element, row.attribute): row for row in TABLE}


class Attributes:
    """The attributes of one file's elements, held against its version; a file that names none against the oldest.

    Each method raises :class:`~pnfarm.errors.DecodeError` with line, element, attribute and what is allowed.
    """

    def __init__(self, version: str) -> None:
        self._version = Decimal(version or VERSIONS[0])
        self._missing: dict[Row, list[int]] = {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the file's version asks for and the file lacks, where it is read nevertheless; each attribute once."""
        return tuple(
            f"line {lines[0]}: {row.element}/@{row.attribute} is missing"
            + (f", and in {len(lines) - 1} more" if len(lines) > 1 else "")
            + f"; {_asking(row)}, {row.lenient}"
            for row, lines in self._missing.items()
        )

    def _value(self, node: Node, attribute: str) -> str:
        value = node.attributes.get(attribute)
        if value is not None:
            return value
        row = _ROWS[node.name, attribute]
        if row.lenient and Decimal(row.required) <= self._version:
            self._missing.setdefault(row, []).append(node.line)
        return row.default

    def text(self, node: Node, attribute: str) -> str:
        return self._value(node, attribute)

    def word(self, node: Node, attribute: str) -> str:
        """A text that is not empty: something refers to it, or cannot do without it."""
        return self._value(node, attribute) or _fail(node, attribute, "a text that is not empty")

    def number(self, node: Node, attribute: str, maximum: int) -> int:
        """An unsigned number; one without a default must be there."""
        try:
            return parse_number(self._value(node, attribute), maximum)
        except ValueError as exc:
            _fail(node, attribute, str(exc))

    def flag(self, node: Node, attribute: str) -> bool:
        found = _FLAGS.get(self._value(node, attribute).strip())
        return found if found is not None else _fail(node, attribute, "true or false")

    def numbers(self, node: Node, attribute: str) -> Numbers:
        try:
            return Numbers.parse(self._value(node, attribute), 0xFFFF)
        except ValueError as exc:
            _fail(node, attribute, str(exc))

    def tokens(self, node: Node, attribute: str) -> tuple[str, ...]:
        return parse_tokens(self._value(node, attribute))


def _fail(node: Node, attribute: str, allowed: str) -> NoReturn:
    row = _ROWS[node.name, attribute]
    node.fail(attribute, allowed if attribute in node.attributes or not row.required else f"{allowed}; {_asking(row)}")


def _asking(row: Row) -> str:
    return "every version asks for it" if row.required == "1.0" else f"V{row.required} and later ask for it"
