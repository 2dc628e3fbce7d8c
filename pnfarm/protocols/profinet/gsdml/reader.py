"""From the octets of a GSDML file of any maker to a :class:`~pnfarm.protocols.profinet.gsdml.document.Gsdml`.

V2.0 to V2.4x: what later versions moved (timings from the DAP to its interface, MAU types from an attribute to a list)
is found in both places; what they added and pnfarm does not use is skipped.  A missing or a wrong value is a
:class:`DecodeError` that names line, element and attribute and says what is allowed.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.gsdml.document import (
    DATA_TYPE_OCTETS,
    DEFAULT_RATIOS,
    DEFAULT_SEND_CLOCKS,
    FIRST_SUBSLOT,
    NO_NUMBERS,
    Certification,
    ChannelDiagnosis,
    Dap,
    DataItem,
    DataItems,
    ExtDiagnosis,
    Gsdml,
    Info,
    InterfaceSubmodule,
    ItemRef,
    ModuleItem,
    PortSubmodule,
    SubmoduleItem,
    UnitDiagnosis,
)
from pnfarm.protocols.profinet.gsdml.records import MAX_RECORD, parse_record, read_ref
from pnfarm.protocols.profinet.gsdml.safe_xml import Node, parse_xml
from pnfarm.protocols.profinet.gsdml.values import Numbers

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord

__all__ = ["ROOT", "parse_gsdml"]

ROOT = "ISO15745Profile"
_VERSION = re.compile(r"GSDML-DeviceProfile-[vV]([0-9]{1,2}(?:\.[0-9]{1,3}){1,2})\.xsd")
_U16 = 0xFFFF
_U32 = 0xFFFF_FFFF
#: Octets of one submodule's data in one direction (IEC 61158-6-10, C_SDU of RT class 1 less a status octet).
_MAX_DATA = 1439


class _Reader:
    def __init__(self, root: Node) -> None:
        self._root = root
        self._process = root.need("ProfileBody", "ApplicationProcess")
        self._texts = {
            node.word("TextId"): node.text("Value")
            for node in self._process.all("ExternalTextList", "PrimaryLanguage", "Text")
        }

    def _text(self, node: Node | None) -> str:
        """The text that TextId names; the name itself when the list has no such text."""
        if node is None:
            return ""
        name = node.text("TextId")
        return self._texts.get(name, name)

    def read(self) -> Gsdml:
        identity = self._root.need("ProfileBody", "DeviceIdentity")
        family = self._root.child("ProfileBody", "DeviceFunction", "Family")
        vendor = identity.child("VendorName")
        version = _VERSION.search(self._root.text("schemaLocation"))
        daps = self._process.all("DeviceAccessPointList", "DeviceAccessPointItem")
        if not daps:
            raise DecodeError(
                "missing-element",
                f"line {self._process.line}: there is no DeviceAccessPointItem, a GSDML file has at least one",
            )
        return Gsdml(
            vendor_id=identity.number("VendorID", _U16),
            device_id=identity.number("DeviceID", _U16),
            vendor_name=vendor.text("Value") if vendor else "",
            info_text=self._text(identity.child("InfoText")),
            main_family=family.text("MainFamily") if family else "",
            product_family=family.text("ProductFamily") if family else "",
            schema_version=f"V{version[1]}" if version else "",
            daps=tuple(map(self._dap, daps)),
            modules=tuple(map(self._module, self._process.all("ModuleList", "ModuleItem"))),
            submodules=tuple(
                self._submodule(node, NO_NUMBERS) for node in self._process.all("SubmoduleList", "SubmoduleItem")
            ),
            pluggable_ports=tuple(
                self._port(node, pluggable=True) for node in self._process.all("SubmoduleList", "PortSubmoduleItem")
            ),
            diagnoses=tuple(
                self._diagnosis(node, profile=profile)
                for item, profile in (("ChannelDiagItem", False), ("ProfileChannelDiagItem", True))
                for node in self._process.all("ChannelDiagList", item)
            ),
            unit_diagnoses=tuple(
                self._unit_diagnosis(node, profile=profile)
                for item, profile in (("UnitDiagTypeItem", False), ("ProfileUnitDiagTypeItem", True))
                for node in self._process.all("UnitDiagTypeList", item)
            ),
        )

    # diagnosis

    def _diagnosis(self, node: Node, *, profile: bool) -> ChannelDiagnosis:
        extended = [
            ExtDiagnosis(ext.number("ErrorType", _U16), self._text(ext.child("Name")), self._text(ext.child("Help")))
            for item in ("ExtChannelDiagItem", "ProfileExtChannelDiagItem")
            for ext in node.all("ExtChannelDiagList", item)
        ]
        return ChannelDiagnosis(
            error_type=node.number("ErrorType", _U16),
            name=self._text(node.child("Name")),
            help=self._text(node.child("Help")),
            api=node.number("API", _U32) if profile else None,
            extended=tuple(sorted(extended, key=lambda ext: ext.error_type)),
        )

    def _unit_diagnosis(self, node: Node, *, profile: bool) -> UnitDiagnosis:
        return UnitDiagnosis(
            user_structure=node.number("UserStructureIdentifier", _U16),
            name=self._text(node.child("Name")),
            help=self._text(node.child("Help")),
            fields=tuple(read_ref(ref, MAX_RECORD, self._text) for ref in node.all("Ref")),
            api=node.number("API", _U32) if profile else None,
        )

    # modules

    def _info(self, node: Node) -> Info:
        info = node.child("ModuleInfo")
        if info is None:
            return Info()

        def value(name: str) -> str:
            found = info.child(name)
            return found.text("Value") if found else ""

        return Info(
            name=self._text(info.child("Name")),
            info_text=self._text(info.child("InfoText")),
            vendor_name=value("VendorName"),
            order_number=value("OrderNumber"),
            hardware_release=value("HardwareRelease"),
            software_release=value("SoftwareRelease"),
        )

    @staticmethod
    def _refs(node: Node, group: str, item: str, target: str, places: str) -> tuple[ItemRef, ...]:
        return tuple(
            ItemRef(
                target=ref.word(target),
                allowed=ref.numbers(f"AllowedIn{places}"),
                used=ref.numbers(f"UsedIn{places}"),
                fixed=ref.numbers(f"FixedIn{places}"),
            )
            for ref in node.all(group, item)
        )

    def _useable_submodules(self, node: Node) -> tuple[ItemRef, ...]:
        return self._refs(node, "UseableSubmodules", "SubmoduleItemRef", "SubmoduleItemTarget", "Subslots")

    def _virtual(self, node: Node) -> tuple[SubmoduleItem, ...]:
        items = node.all("VirtualSubmoduleList", "VirtualSubmoduleItem")
        return tuple(self._submodule(item, FIRST_SUBSLOT) for item in items)

    def _ports(self, node: Node) -> tuple[PortSubmodule, ...]:
        return tuple(map(self._port, node.all("SystemDefinedSubmoduleList", "PortSubmoduleItem")))

    def _module(self, node: Node) -> ModuleItem:
        return ModuleItem(
            id=node.word("ID"),
            ident=node.number("ModuleIdentNumber", _U32),
            info=self._info(node),
            physical_subslots=node.numbers("PhysicalSubslots"),
            submodules=self._virtual(node),
            ports=self._ports(node),
            useable=self._useable_submodules(node),
        )

    def _dap(self, node: Node) -> Dap:
        io = node.child("IOConfigData")
        return Dap(
            id=node.word("ID"),
            ident=node.number("ModuleIdentNumber", _U32),
            info=self._info(node),
            pnio_version=node.text("PNIO_Version"),
            required_schema_version=node.text("RequiredSchemaVersion", "V1.0"),
            physical_slots=node.numbers("PhysicalSlots"),
            fixed_slots=node.numbers("FixedInSlots"),
            allowed_slots=node.numbers("AllowedInSlots"),
            physical_subslots=node.numbers("PhysicalSubslots"),
            min_device_interval=node.number("MinDeviceInterval", _U16),
            implementation_type=node.text("ImplementationType"),
            dns_name=node.text("DNS_CompatibleName"),
            instance=node.number("ObjectUUID_LocalIndex", _U16, 1),
            multiple_write=node.flag("MultipleWriteSupported"),
            application_seconds=node.number("RemoteApplicationTimeout", _U16, 0),
            ioxs_required=node.flag("IOXS_Required", default=True),
            device_access=node.flag("DeviceAccessSupported"),
            device_access_ars=node.number("NumberOfDeviceAccessAR", _U16, 0),
            shared_device=node.flag("SharedDeviceSupported"),
            shared_input=node.flag("SharedInputSupported"),
            check_device_id=node.flag("CheckDeviceID_Allowed"),
            name_not_transferable=node.flag("NameOfStationNotTransferable"),
            lldp_nod=node.flag("LLDP_NoD_Supported"),
            reset_modes=node.numbers("ResetToFactoryModes"),
            address_assignment=node.tokens("AddressAssignment", ("DCP",)),
            max_record=node.number("MaxSupportedRecordSize", _U32, 4068),
            max_input=io.number("MaxInputLength", _U16, 0) if io else 0,
            max_output=io.number("MaxOutputLength", _U16, 0) if io else 0,
            max_data=io.number("MaxDataLength", _U16, 0) if io else 0,
            certification=self._certification(node),
            modules=self._refs(node, "UseableModules", "ModuleItemRef", "ModuleItemTarget", "Slots"),
            submodules=self._virtual(node),
            interfaces=tuple(
                self._interface(item, node) for item in node.all("SystemDefinedSubmoduleList", "InterfaceSubmoduleItem")
            ),
            ports=self._ports(node),
            useable=self._useable_submodules(node),
        )

    @staticmethod
    def _certification(node: Node) -> Certification | None:
        found = node.child("CertificationInfo")
        if found is None:
            return None
        return Certification(
            found.text("ConformanceClass"), found.tokens("ApplicationClass"), found.text("NetloadClass")
        )

    # submodules

    def _records(self, node: Node) -> tuple[ParameterRecord, ...]:
        return tuple(parse_record(r, self._text) for r in node.all("RecordDataList", "ParameterRecordDataItem"))

    def _submodule(self, node: Node, subslots: Numbers) -> SubmoduleItem:
        io = node.child("IOData")
        return SubmoduleItem(
            id=node.word("ID"),
            ident=node.number("SubmoduleIdentNumber", _U32),
            info=self._info(node),
            api=node.number("API", _U32, 0),
            fixed=node.numbers("FixedInSubslots", subslots),
            inputs=self._data(io, "Input"),
            outputs=self._data(io, "Output"),
            iops_length=io.number("IOPS_Length", 0xFF, 1) if io else 1,
            iocs_length=io.number("IOCS_Length", 0xFF, 1) if io else 1,
            records=self._records(node),
            may_issue_process_alarm=node.flag("MayIssueProcessAlarm"),
            writeable_im=node.numbers("Writeable_IM_Records"),
            profisafe=node.flag("PROFIsafeSupported"),
        )

    def _data(self, io: Node | None, direction: str) -> DataItems | None:
        node = io.child(direction) if io else None
        if node is None:
            return None
        items = DataItems(
            tuple(map(self._data_item, node.all("DataItem"))),
            whole=node.text("Consistency", "Item consistency") == "All items consistency",
        )
        if items.octets > _MAX_DATA:
            raise DecodeError(
                "bad-value", f"line {node.line}: {direction} has {items.octets} octets, allowed are up to {_MAX_DATA}"
            )
        return items

    def _data_item(self, node: Node) -> DataItem:
        kind = node.word("DataType")
        known = DATA_TYPE_OCTETS.get(kind)
        # types without a length of their own, and types missing in this table, give theirs
        octets = known if known is not None else node.number("Length", _U16)
        return DataItem(kind, octets, self._text(node), node.flag("UseAsBits"))

    def _port(self, node: Node, *, pluggable: bool = False) -> PortSubmodule:
        listed = [item.number("Value", _U16) for item in node.all("MAUTypeList", "MAUTypeItem")]
        return PortSubmodule(
            id=node.word("ID"),
            ident=node.number("SubmoduleIdentNumber", _U32),
            subslot=0 if pluggable else node.number("SubslotNumber", _U16),
            name=self._info(node).name if pluggable else self._text(node),
            mau_types=Numbers.of(listed) if listed else node.numbers("MAUTypes"),
            max_rx_delay=node.number("MaxPortRxDelay", _U32, 0),
            max_tx_delay=node.number("MaxPortTxDelay", _U32, 0),
            records=self._records(node),
        )

    def _interface(self, node: Node, dap: Node) -> InterfaceSubmodule:
        # V2.0 has them at the DAP
        relations = node.child("ApplicationRelations") or dap.child("ApplicationRelations")
        timing = relations.child("TimingProperties") if relations else None
        return InterfaceSubmodule(
            id=node.word("ID"),
            ident=node.number("SubmoduleIdentNumber", _U32),
            subslot=node.number("SubslotNumber", _U16, 0x8000),
            name=self._text(node),
            rt_classes=node.tokens("SupportedRT_Classes", ("RT_CLASS_1",)),
            protocols=node.tokens("SupportedProtocols"),
            dcp_hello=node.flag("DCP_HelloSupported"),
            ptp_boundary=node.flag("PTP_BoundarySupported"),
            dcp_boundary=node.flag("DCP_BoundarySupported"),
            network_component_diagnosis=node.flag("NetworkComponentDiagnosisSupported"),
            startup_modes=relations.tokens("StartupMode", ("Legacy",)) if relations else ("Legacy",),
            number_of_ars=relations.number("NumberOfAR", _U16, 1) if relations else 1,
            pull_module_alarm=relations.flag("PullModuleAlarmSupported") if relations else False,
            send_clocks=timing.numbers("SendClock", DEFAULT_SEND_CLOCKS) if timing else DEFAULT_SEND_CLOCKS,
            ratios=(
                timing.numbers("ReductionRatio", timing.numbers("ReductionRatioPow2", DEFAULT_RATIOS))
                if timing
                else DEFAULT_RATIOS
            ),
            records=self._records(node),
        )


def parse_gsdml(data: bytes) -> Gsdml:
    """Read a file's octets; :class:`DecodeError` for anything but a GSDML file."""
    root = parse_xml(data)
    if root.name != ROOT:
        raise DecodeError(
            "bad-type", f"line {root.line}: the file's root is {root.name}, that of a GSDML file is {ROOT}"
        )
    return _Reader(root).read()
