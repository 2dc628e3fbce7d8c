"""From the octets of a GSDML file of any maker to a :class:`~pnfarm.protocols.profinet.gsdml.document.Gsdml`.

V1.0 to V2.45: what a version has, asks for and leaves to a default is in `versions`; what a later version put into
another place (relations from the access point to its interface, MAU types from an attribute to a list) is found in
both.  What pnfarm does not use is skipped.  A wrong value, a missing one, an ID or a place that is taken twice, and a
reference that leads nowhere are a :class:`DecodeError` that names line, element and attribute and says what is allowed.

IDs count where something refers to them: makers give those of virtual submodules, interfaces and ports twice, and
texts that no list has; such a text is shown as its ID.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.gsdml.document import (
    DATA_TYPE_OCTETS,
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
    Relations,
    SubmoduleItem,
    UnitDiagnosis,
)
from pnfarm.protocols.profinet.gsdml.f_parameters import read_f_parameters
from pnfarm.protocols.profinet.gsdml.file_texts import FileTexts, by_id
from pnfarm.protocols.profinet.gsdml.records import MAX_RECORD, parse_record, read_ref
from pnfarm.protocols.profinet.gsdml.safe_xml import Node, parse_xml
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.gsdml.versions import Attributes, version_of
from pnfarm.protocols.profinet.wire.cm.iocr import MAX_C_SDU

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord

__all__ = ["ROOT", "parse_gsdml"]

ROOT = "ISO15745Profile"
_U16 = 0xFFFF
_U32 = 0xFFFF_FFFF
#: Octets of one submodule's data in one direction: there is a status octet.
_MAX_DATA = MAX_C_SDU - 1
#: MAUType, the attribute of V2.0, as numbers of MAU types (IETF RFC 4836).
_MAU_TYPES = {
    "100BASETXFD": 16,
    "100BASEFXFD": 18,
    "1000BASEXFD": 22,
    "1000BASELXFD": 24,
    "1000BASESXFD": 26,
    "1000BASETFD": 30,
}
#: SupportedRT_Class, the attribute of V2.0: a class with those below it.
_RT_CLASSES = {
    "Class1": ("RT_CLASS_1",),
    "Class2": ("RT_CLASS_1", "RT_CLASS_2"),
    "Class3": ("RT_CLASS_1", "RT_CLASS_2", "RT_CLASS_3"),
}


class _Reader:
    def __init__(self, root: Node, version: str) -> None:
        self._root = root
        self._version = version
        self._at = Attributes(version)
        self._process = root.need("ProfileBody", "ApplicationProcess")
        self._texts = FileTexts(self._at, self._process)
        self._daps = by_id(self._at, self._process.all("DeviceAccessPointList", "DeviceAccessPointItem"))
        self._modules = by_id(self._at, self._process.all("ModuleList", "ModuleItem"))
        listed = self._process.child("SubmoduleList")
        self._pluggable = by_id(
            self._at,
            (
                node
                for node in (listed.children if listed else ())
                if node.name in {"SubmoduleItem", "PortSubmoduleItem"}
            ),
        )
        self._shared_records = {
            name: parse_record(self._at, node, self._texts)
            for name, node in by_id(self._at, self._process.all("RecordDataList", "ParameterRecordDataItem")).items()
        }

    def read(self) -> Gsdml:
        identity = self._root.need("ProfileBody", "DeviceIdentity")
        family = self._root.child("ProfileBody", "DeviceFunction", "Family")
        vendor = identity.child("VendorName")
        if not self._daps:
            raise DecodeError(
                "missing-element",
                f"line {self._process.line}: there is no DeviceAccessPointItem, a GSDML file has at least one",
            )
        found = Gsdml(
            vendor_id=self._at.number(identity, "VendorID", _U16),
            device_id=self._at.number(identity, "DeviceID", _U16),
            vendor_name=vendor.text("Value") if vendor else "",
            info_text=self._texts.text(identity.child("InfoText")),
            main_family=family.text("MainFamily") if family else "",
            product_family=family.text("ProductFamily") if family else "",
            schema_version=f"V{self._version}" if self._version else "",
            daps=tuple(map(self._dap, self._daps.values())),
            modules=tuple(map(self._module, self._modules.values())),
            submodules=tuple(
                self._submodule(node) for node in self._pluggable.values() if node.name == "SubmoduleItem"
            ),
            pluggable_ports=tuple(
                self._port(node, pluggable=True)
                for node in self._pluggable.values()
                if node.name == "PortSubmoduleItem"
            ),
            diagnoses=tuple(
                self._diagnosis(node, profile=item == "ProfileChannelDiagItem")
                for item in ("ChannelDiagItem", "SystemDefinedChannelDiagItem", "ProfileChannelDiagItem")
                for node in self._process.all("ChannelDiagList", item)
            ),
            unit_diagnoses=tuple(
                self._unit_diagnosis(node, profile=profile)
                for item, profile in (("UnitDiagTypeItem", False), ("ProfileUnitDiagTypeItem", True))
                for node in self._process.all("UnitDiagTypeList", item)
            ),
        )
        return replace(found, languages=self._texts.languages(), remarks=self._at.remarks)

    # diagnosis

    def _diagnosis(self, node: Node, *, profile: bool) -> ChannelDiagnosis:
        system = node.name == "SystemDefinedChannelDiagItem"
        extended = [
            ExtDiagnosis(
                self._at.number(ext, "ErrorType", _U16),
                self._texts.text(ext.child("Name")),
                self._texts.text(ext.child("Help")),
                self._at.tokens(ext, "MaintenanceAlarmState"),
            )
            for item in ("ExtChannelDiagItem", "ProfileExtChannelDiagItem")
            for ext in node.all("ExtChannelDiagList", item)
        ]
        return ChannelDiagnosis(
            error_type=self._at.number(node, "ErrorType", _U16),
            name=self._texts.text(node.child("Name")),
            help=self._texts.text(node.child("Help")),
            api=self._at.number(node, "API", _U32) if profile else None,
            extended=tuple(sorted(extended, key=lambda ext: ext.error_type)),
            severities=("D",) if system else self._at.tokens(node, "MaintenanceAlarmState"),
        )

    def _unit_diagnosis(self, node: Node, *, profile: bool) -> UnitDiagnosis:
        return UnitDiagnosis(
            user_structure=self._at.number(node, "UserStructureIdentifier", _U16),
            name=self._texts.text(node.child("Name")),
            help=self._texts.text(node.child("Help")),
            fields=tuple(read_ref(self._at, ref, MAX_RECORD, self._texts) for ref in node.all("Ref")),
            api=self._at.number(node, "API", _U32) if profile else None,
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
            name=self._texts.text(info.child("Name")),
            info_text=self._texts.text(info.child("InfoText")),
            vendor_name=value("VendorName"),
            order_number=value("OrderNumber"),
            hardware_release=value("HardwareRelease"),
            software_release=value("SoftwareRelease"),
        )

    def _refs(self, nodes: Sequence[Node], target: str, known: Container[str], places: str) -> tuple[ItemRef, ...]:
        found = []
        for ref in nodes:
            name = self._at.word(ref, target)
            if name not in known:
                ref.refuse(target, "the ID of none that the file describes")
            found.append(
                ItemRef(
                    target=name,
                    allowed=self._at.numbers(ref, f"AllowedIn{places}"),
                    used=self._at.numbers(ref, f"UsedIn{places}"),
                    fixed=self._at.numbers(ref, f"FixedIn{places}"),
                    line=ref.line,
                )
            )
        return tuple(found)

    def _useable_submodules(self, node: Node) -> tuple[ItemRef, ...]:
        refs = node.all("UseableSubmodules", "SubmoduleItemRef")
        return self._refs(refs, "SubmoduleItemTarget", self._pluggable, "Subslots")

    def _virtual(self, node: Node) -> tuple[SubmoduleItem, ...]:
        return tuple(map(self._submodule, node.all("VirtualSubmoduleList", "VirtualSubmoduleItem")))

    def _ports(self, node: Node) -> tuple[PortSubmodule, ...]:
        return tuple(map(self._port, node.all("SystemDefinedSubmoduleList", "PortSubmoduleItem")))

    def _check_subslots(self, node: Node) -> None:
        """What a module or an access point has built in is in subslots of its own."""
        taken = [
            (*span, one)
            for one in node.all("VirtualSubmoduleList", "VirtualSubmoduleItem")
            for span in self._at.numbers(one, "FixedInSubslots").ranges
        ]
        for item in ("InterfaceSubmoduleItem", "PortSubmoduleItem"):
            for one in node.all("SystemDefinedSubmoduleList", item):
                subslot = self._at.number(one, "SubslotNumber", _U16)
                taken.append((subslot, subslot, one))
        taken.sort(key=lambda span: (span[0], span[2].line))
        for (_, last, first), (begin, _, second) in pairwise(taken):
            if begin <= last:
                one, other = sorted((first, second), key=lambda found: found.line)
                place = f"subslot 0x{begin:04X}, as the {one.name} in line {one.line}"
                raise DecodeError(
                    "bad-value", f"line {other.line}: {other.name} is in {place}; one submodule fits there"
                )

    def _module(self, node: Node) -> ModuleItem:
        self._check_subslots(node)
        return ModuleItem(
            id=self._at.word(node, "ID"),
            ident=self._at.number(node, "ModuleIdentNumber", _U32),
            info=self._info(node),
            physical_subslots=self._at.numbers(node, "PhysicalSubslots"),
            submodules=self._virtual(node),
            ports=self._ports(node),
            useable=self._useable_submodules(node),
        )

    def _dap(self, node: Node) -> Dap:
        self._check_subslots(node)
        io = node.child("IOConfigData")
        interfaces = node.all("SystemDefinedSubmoduleList", "InterfaceSubmoduleItem")
        relations = node.child("ApplicationRelations")
        modules = node.all("UseableModules", "ModuleItemRef")
        return Dap(
            id=self._at.word(node, "ID"),
            ident=self._at.number(node, "ModuleIdentNumber", _U32),
            info=self._info(node),
            pnio_version=self._at.text(node, "PNIO_Version"),
            required_schema_version=self._at.text(node, "RequiredSchemaVersion"),
            physical_slots=self._at.numbers(node, "PhysicalSlots"),
            fixed_slots=self._at.numbers(node, "FixedInSlots"),
            allowed_slots=self._at.numbers(node, "AllowedInSlots"),
            physical_subslots=self._at.numbers(node, "PhysicalSubslots"),
            min_device_interval=self._at.number(node, "MinDeviceInterval", _U16),
            implementation_type=self._at.text(node, "ImplementationType"),
            dns_name=self._at.text(node, "DNS_CompatibleName"),
            instance=self._at.number(node, "ObjectUUID_LocalIndex", _U16),
            multiple_write=self._at.flag(node, "MultipleWriteSupported"),
            application_seconds=self._at.number(node, "RemoteApplicationTimeout", _U16),
            ioxs_required=self._at.flag(node, "IOXS_Required"),
            device_access=self._at.flag(node, "DeviceAccessSupported"),
            device_access_ars=self._at.number(node, "NumberOfDeviceAccessAR", _U16),
            shared_device=self._at.flag(node, "SharedDeviceSupported"),
            shared_input=self._at.flag(node, "SharedInputSupported"),
            check_device_id=self._at.flag(node, "CheckDeviceID_Allowed"),
            name_not_transferable=self._at.flag(node, "NameOfStationNotTransferable"),
            lldp_nod=self._at.flag(node, "LLDP_NoD_Supported"),
            reset_modes=self._at.numbers(node, "ResetToFactoryModes"),
            address_assignment=self._at.tokens(node, "AddressAssignment"),
            max_record=self._at.number(node, "MaxSupportedRecordSize", _U32),
            max_input=self._at.number(io, "MaxInputLength", _U16) if io else 0,
            max_output=self._at.number(io, "MaxOutputLength", _U16) if io else 0,
            max_data=self._at.number(io, "MaxDataLength", _U16) if io else 0,
            certification=self._certification(node),
            modules=self._refs(modules, "ModuleItemTarget", self._modules, "Slots"),
            submodules=self._virtual(node),
            interfaces=tuple(self._interface(one, node) for one in interfaces),
            ports=self._ports(node),
            useable=self._useable_submodules(node),
            own_relations=self._relations(relations) if relations else None,
        )

    def _certification(self, node: Node) -> Certification | None:
        found = node.child("CertificationInfo")
        if found is None:
            return None
        return Certification(
            self._at.text(found, "ConformanceClass"),
            self._at.tokens(found, "ApplicationClass"),
            self._at.text(found, "NetloadClass"),
        )

    # submodules

    def _records(self, node: Node) -> tuple[ParameterRecord, ...]:
        """Its own, and those of the whole file that it refers to; each index once."""
        found: dict[int, ParameterRecord] = {}
        listed = node.child("RecordDataList")
        for item in listed.children if listed else ():
            if item.name == "ParameterRecordDataItem":
                record = parse_record(self._at, item, self._texts)
            elif item.name == "ParameterRecordDataRef":
                record = self._shared_record(item)
            else:
                continue
            if record.index in found:
                raise DecodeError(
                    "bad-value", f"line {item.line}: record {record.index} is there already, each is once"
                )
            found[record.index] = record
        return tuple(found.values())

    def _shared_record(self, ref: Node) -> ParameterRecord:
        record = self._shared_records.get(self._at.word(ref, "RecordDataTarget"))
        if record is None:
            ref.refuse("RecordDataTarget", "the ID of none that the file describes")
        if "TransferSequence" not in ref.attributes:
            return record
        return replace(record, transfer_sequence=self._at.number(ref, "TransferSequence", _U16))

    def _submodule(self, node: Node) -> SubmoduleItem:
        """A virtual submodule, or a pluggable one, which names no subslot."""
        io = node.child("IOData")
        virtual = node.name == "VirtualSubmoduleItem"
        safe = node.child("RecordDataList", "F_ParameterRecordDataItem")
        return SubmoduleItem(
            id=self._at.text(node, "ID"),
            ident=self._at.number(node, "SubmoduleIdentNumber", _U32),
            info=self._info(node),
            api=self._at.number(node, "API", _U32),
            fixed=self._at.numbers(node, "FixedInSubslots") if virtual else NO_NUMBERS,
            inputs=self._data(io, "Input"),
            outputs=self._data(io, "Output"),
            iops_length=self._at.number(io, "IOPS_Length", 0xFF) if io else 1,
            iocs_length=self._at.number(io, "IOCS_Length", 0xFF) if io else 1,
            records=self._records(node),
            may_issue_process_alarm=self._at.flag(node, "MayIssueProcessAlarm"),
            writeable_im=self._at.numbers(node, "Writeable_IM_Records"),
            profisafe=self._at.flag(node, "PROFIsafeSupported"),
            f_parameters=read_f_parameters(self._at, safe) if safe else None,
            line=node.line,
        )

    def _data(self, io: Node | None, direction: str) -> DataItems | None:
        node = io.child(direction) if io else None
        if node is None:
            return None
        items = DataItems(
            tuple(map(self._data_item, node.all("DataItem"))),
            whole=self._at.text(node, "Consistency") == "All items consistency",
        )
        if items.octets > _MAX_DATA:
            raise DecodeError(
                "bad-value", f"line {node.line}: {direction} has {items.octets} octets, allowed are up to {_MAX_DATA}"
            )
        return items

    def _data_item(self, node: Node) -> DataItem:
        kind = self._at.word(node, "DataType")
        known = DATA_TYPE_OCTETS.get(kind)
        # types without a length of their own, and types missing in this table, give theirs
        octets = known if known is not None else self._at.number(node, "Length", _U16)
        bits: dict[int, str] = {}
        for bit in node.all("BitDataItem"):
            bits.setdefault(self._at.number(bit, "BitOffset", 0xFFFF), self._texts.text(bit))
        name, as_bits = self._texts.text(node), self._at.flag(node, "UseAsBits")
        return DataItem(kind, octets, name, as_bits, tuple(bits.items()))

    def _port(self, node: Node, *, pluggable: bool = False) -> PortSubmodule:
        return PortSubmodule(
            id=self._at.text(node, "ID"),
            ident=self._at.number(node, "SubmoduleIdentNumber", _U32),
            subslot=0 if pluggable else self._at.number(node, "SubslotNumber", _U16),
            name=self._info(node).name if pluggable else self._texts.text(node),
            mau_types=self._mau_types(node),
            max_rx_delay=self._at.number(node, "MaxPortRxDelay", _U32),
            max_tx_delay=self._at.number(node, "MaxPortTxDelay", _U32),
            records=self._records(node),
            writeable_im=self._at.numbers(node, "Writeable_IM_Records"),
        )

    def _mau_types(self, node: Node) -> Numbers:
        """In the newest form that the file has."""
        if node.child("MAUTypeList") is not None:
            listed = node.all("MAUTypeList", "MAUTypeItem")
            return Numbers.of(self._at.number(item, "Value", _U16) for item in listed)
        if "MAUTypes" in node.attributes:
            return self._at.numbers(node, "MAUTypes")
        known = _MAU_TYPES.get(self._at.text(node, "MAUType"))
        return NO_NUMBERS if known is None else Numbers.of([known])

    def _rt_classes(self, node: Node) -> tuple[str, ...]:
        if "SupportedRT_Classes" in node.attributes:
            return self._at.tokens(node, "SupportedRT_Classes")
        return _RT_CLASSES.get(self._at.text(node, "SupportedRT_Class"), ())

    def _interface(self, node: Node, dap: Node) -> InterfaceSubmodule:
        relations = node.child("ApplicationRelations") or dap.child("ApplicationRelations")
        return InterfaceSubmodule(
            id=self._at.text(node, "ID"),
            ident=self._at.number(node, "SubmoduleIdentNumber", _U32),
            subslot=self._at.number(node, "SubslotNumber", _U16),
            name=self._texts.text(node),
            rt_classes=self._rt_classes(node),
            protocols=self._at.tokens(node, "SupportedProtocols"),
            dcp_hello=self._at.flag(node, "DCP_HelloSupported"),
            ptp_boundary=self._at.flag(node, "PTP_BoundarySupported"),
            dcp_boundary=self._at.flag(node, "DCP_BoundarySupported"),
            network_component_diagnosis=self._at.flag(node, "NetworkComponentDiagnosisSupported"),
            relations=self._relations(relations) if relations else Relations(),
            records=self._records(node),
            writeable_im=self._at.numbers(node, "Writeable_IM_Records"),
        )

    def _relations(self, node: Node) -> Relations:
        timing = node.child("TimingProperties") or Node("TimingProperties", node.line)
        named = (name for name in ("ReductionRatio", "ReductionRatioPow2") if name in timing.attributes)
        return Relations(
            startup_modes=self._at.tokens(node, "StartupMode"),
            number_of_ars=self._at.number(node, "NumberOfAR", _U16),
            additional_input_crs=self._at.number(node, "NumberOfAdditionalInputCR", _U16),
            additional_output_crs=self._at.number(node, "NumberOfAdditionalOutputCR", _U16),
            pull_module_alarm=self._at.flag(node, "PullModuleAlarmSupported"),
            send_clocks=self._at.numbers(timing, "SendClock"),
            ratios=self._at.numbers(timing, next(named, "ReductionRatio")),
        )


def parse_gsdml(data: bytes, file_name: str = "") -> Gsdml:
    """Read a file's octets; :class:`DecodeError` for anything but a GSDML file.

    ``file_name`` says the schema's version where the file does not.
    """
    root = parse_xml(data)
    if root.name != ROOT:
        raise DecodeError(
            "bad-type", f"line {root.line}: the file's root is {root.name}, that of a GSDML file is {ROOT}"
        )
    return _Reader(root, version_of(root.text("schemaLocation"), file_name)).read()
