"""From a :class:`~pnfarm.protocols.profinet.gsdml.document.Gsdml` to the text of its file.

What the schema gives a default is written only where it differs; ``parse_gsdml(emit_gsdml(x)) == x``.  There is one
language, the primary one.
Elements and attributes are in the order of the schema (PI, GSDML-DeviceProfile).
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.document import (
    DATA_TYPE_OCTETS,
    DEFAULT_RATIOS,
    DEFAULT_SEND_CLOCKS,
    FIRST_SUBSLOT,
    NO_NUMBERS,
    PROFILE_TYPES,
    Gsdml,
    SubmoduleItem,
)
from pnfarm.protocols.profinet.gsdml.safe_xml import quoted
from pnfarm.protocols.profinet.gsdml.values import Numbers, emit_octets, emit_tokens

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pnfarm.protocols.profinet.gsdml.document import (
        Certification,
        ChannelDiagnosis,
        Dap,
        DataItems,
        Info,
        InterfaceSubmodule,
        ItemRef,
        ModuleItem,
        PortSubmodule,
        Relations,
        UnitDiagnosis,
    )
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef

__all__ = ["emit_gsdml"]

_NAMESPACE = "http://www.profibus.com/GSDML/2003/11/DeviceProfile"
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
#: The head that ISO 15745-1 asks for, the same in every GSDML file.
_HEADER = (
    ("ProfileIdentification", "PROFINET Device Profile"),
    ("ProfileRevision", "1.00"),
    ("ProfileName", "Device Profile for PROFINET Devices"),
    ("ProfileSource", "PROFIBUS Nutzerorganisation e. V. (PNO)"),
    ("ProfileClassID", "Device"),
)
_REFERENCE = (("ISO15745Part", "4"), ("ISO15745Edition", "1"), ("ProfileTechnology", "GSDML"))

#: An attribute: its name, its value, None to leave it out.
Attribute = tuple[str, str | None]


def _flag(name: str, value: bool, *, default: bool = False) -> Attribute:
    return name, None if value == default else str(value).lower()


def _text(name: str, value: str, default: str = "") -> Attribute:
    return name, None if value == default else value


def _number(name: str, value: int, default: int | None = None) -> Attribute:
    return name, None if value == default else str(value)


def _numbers(name: str, value: Numbers, default: Numbers | None = None) -> Attribute:
    return name, None if value == (NO_NUMBERS if default is None else default) else value.emit()


def _api(value: int | None) -> Attribute:
    """The API attribute of what belongs to a profile."""
    return "API", None if value is None else str(value)


def _severities(value: tuple[str, ...]) -> Attribute:
    return _text("MaintenanceAlarmState", emit_tokens(value), "D")


def _listed(name: str, value: Numbers, default: Numbers) -> Attribute:
    """A value list without ranges, as tools are used to for powers of two."""
    return name, None if value == default else " ".join(map(str, value))


class _Writer:
    def __init__(self) -> None:
        self._lines: list[str] = []
        self._depth = 0
        self._texts: dict[str, str] = {}
        self._values: dict[tuple[tuple[str, str], ...], str] = {}

    def _element(self, name: str, *attributes: Attribute) -> None:
        """An element without children."""
        self._lines.append(f"{'  ' * self._depth}<{name}{_written(attributes)}/>")

    @contextmanager
    def _inside(self, name: str, *attributes: Attribute) -> Iterator[None]:
        """An element around what is written meanwhile."""
        self._lines.append(f"{'  ' * self._depth}<{name}{_written(attributes)}>")
        self._depth += 1
        yield
        self._depth -= 1
        self._lines.append(f"{'  ' * self._depth}</{name}>")

    @contextmanager
    def _list(self, name: str) -> Iterator[None]:
        """The same; left out when nothing is in it."""
        before = len(self._lines)
        with self._inside(name):
            yield
        if len(self._lines) == before + 2:
            del self._lines[before:]

    def _text_id(self, text: str) -> str:
        """The TextId of ``text`` in the list at the end."""
        return self._texts.setdefault(text, f"T{len(self._texts) + 1}")

    def _named(self, name: str, text: str) -> None:
        self._element(name, ("TextId", self._text_id(text)))

    def write(self, gsdml: Gsdml) -> str:
        self._lines.append('<?xml version="1.0" encoding="utf-8"?>')
        version = gsdml.schema_version
        location = f"{_NAMESPACE} ..\\xsd\\GSDML-DeviceProfile-{version}.xsd" if version else None
        root = (("xmlns", _NAMESPACE), ("xmlns:xsi", _XSI), ("xsi:schemaLocation", location))
        with self._inside("ISO15745Profile", *root):
            self._header()
            with self._inside("ProfileBody"):
                identity = (("VendorID", f"0x{gsdml.vendor_id:04X}"), ("DeviceID", f"0x{gsdml.device_id:04X}"))
                with self._inside("DeviceIdentity", *identity):
                    self._named("InfoText", gsdml.info_text)
                    self._element("VendorName", ("Value", gsdml.vendor_name))
                with self._inside("DeviceFunction"):
                    family = _text("ProductFamily", gsdml.product_family)
                    self._element("Family", ("MainFamily", gsdml.main_family), family)
                with self._inside("ApplicationProcess"):
                    self._process(gsdml)
        return "\n".join(self._lines) + "\n"

    def _process(self, gsdml: Gsdml) -> None:
        with self._inside("DeviceAccessPointList"):
            for dap in gsdml.daps:
                self._dap(dap)
        with self._list("ModuleList"):
            for module in gsdml.modules:
                self._module(module)
        with self._list("SubmoduleList"):
            for submodule in gsdml.submodules:
                # what refers to a pluggable one names its subslots
                self._submodule("SubmoduleItem", submodule, submodule.fixed)
            for port in gsdml.pluggable_ports:
                self._port(port, pluggable=True)
        before_values = len(self._lines)
        self._diagnoses(gsdml.diagnoses)
        self._unit_diagnoses(gsdml.unit_diagnoses)
        # a list that comes before some of what refers to it
        after_values, self._lines = self._lines[before_values:], self._lines[:before_values]
        self._value_list()
        self._lines += after_values
        with self._inside("ExternalTextList"), self._inside("PrimaryLanguage"):
            for text, text_id in self._texts.items():
                self._element("Text", ("TextId", text_id), ("Value", text))

    def _header(self) -> None:
        with self._inside("ProfileHeader"):
            for name, value in _HEADER:
                self._lines.append(f"{'  ' * self._depth}<{name}>{value}</{name}>")
            with self._inside("ISO15745Reference"):
                for name, value in _REFERENCE:
                    self._lines.append(f"{'  ' * self._depth}<{name}>{value}</{name}>")

    # modules

    def _info(self, info: Info) -> None:
        with self._inside("ModuleInfo"):
            self._named("Name", info.name)
            self._named("InfoText", info.info_text)
            for name, value in (
                ("VendorName", info.vendor_name),
                ("OrderNumber", info.order_number),
                ("HardwareRelease", info.hardware_release),
                ("SoftwareRelease", info.software_release),
            ):
                if value:
                    self._element(name, ("Value", value))

    def _refs(self, refs: Sequence[ItemRef], group: str, item: str, target: str, places: str) -> None:
        with self._list(group):
            for ref in refs:
                self._element(
                    item,
                    (target, ref.target),
                    _numbers(f"AllowedIn{places}", ref.allowed),
                    _numbers(f"UsedIn{places}", ref.used),
                    _numbers(f"FixedIn{places}", ref.fixed),
                )

    def _useable(self, refs: Sequence[ItemRef]) -> None:
        self._refs(refs, "UseableSubmodules", "SubmoduleItemRef", "SubmoduleItemTarget", "Subslots")

    def _virtual(self, submodules: Sequence[SubmoduleItem]) -> None:
        with self._list("VirtualSubmoduleList"):
            for submodule in submodules:
                self._submodule("VirtualSubmoduleItem", submodule, FIRST_SUBSLOT)

    def _system(self, interfaces: Iterable[InterfaceSubmodule], ports: Iterable[PortSubmodule]) -> None:
        with self._list("SystemDefinedSubmoduleList"):
            for interface in interfaces:
                self._interface(interface)
            for port in ports:
                self._port(port)

    def _module(self, module: ModuleItem) -> None:
        with self._inside(
            "ModuleItem",
            ("ID", module.id),
            ("ModuleIdentNumber", f"0x{module.ident:08X}"),
            _numbers("PhysicalSubslots", module.physical_subslots),
        ):
            self._info(module.info)
            self._virtual(module.submodules)
            self._system((), module.ports)
            self._useable(module.useable)

    def _dap(self, dap: Dap) -> None:
        with self._inside(
            "DeviceAccessPointItem",
            ("ID", dap.id),
            _text("PNIO_Version", dap.pnio_version),
            _numbers("PhysicalSlots", dap.physical_slots),
            ("ModuleIdentNumber", f"0x{dap.ident:08X}"),
            _numbers("PhysicalSubslots", dap.physical_subslots),
            _number("MinDeviceInterval", dap.min_device_interval),
            _text("ImplementationType", dap.implementation_type),
            ("DNS_CompatibleName", dap.dns_name),
            _numbers("AllowedInSlots", dap.allowed_slots),
            _numbers("FixedInSlots", dap.fixed_slots),
            _number("ObjectUUID_LocalIndex", dap.instance),
            _flag("DeviceAccessSupported", dap.device_access),
            _number("NumberOfDeviceAccessAR", dap.device_access_ars, 0),
            _flag("MultipleWriteSupported", dap.multiple_write),
            _flag("IOXS_Required", dap.ioxs_required, default=True),
            _text("AddressAssignment", emit_tokens(dap.address_assignment), "DCP"),
            _number("RemoteApplicationTimeout", dap.application_seconds, 0),
            _number("MaxSupportedRecordSize", dap.max_record, 4068),
            _text("RequiredSchemaVersion", dap.required_schema_version, "V1.0"),
            _flag("SharedDeviceSupported", dap.shared_device),
            _flag("SharedInputSupported", dap.shared_input),
            # the schema requires these two, whatever their values
            ("CheckDeviceID_Allowed", str(dap.check_device_id).lower()),
            ("NameOfStationNotTransferable", str(dap.name_not_transferable).lower()),
            _flag("LLDP_NoD_Supported", dap.lldp_nod),
            _numbers("ResetToFactoryModes", dap.reset_modes),
        ):
            self._info(dap.info)
            self._certification(dap.certification)
            self._element(
                "IOConfigData",
                _number("MaxInputLength", dap.max_input),
                _number("MaxOutputLength", dap.max_output),
                _number("MaxDataLength", dap.max_data, 0),
            )
            self._refs(dap.modules, "UseableModules", "ModuleItemRef", "ModuleItemTarget", "Slots")
            self._virtual(dap.submodules)
            self._system(dap.interfaces, dap.ports)
            if dap.own_relations is not None:
                self._relations(dap.own_relations)
            self._useable(dap.useable)

    def _certification(self, certification: Certification | None) -> None:
        if certification is None:
            return
        self._element(
            "CertificationInfo",
            ("ConformanceClass", certification.conformance_class or None),
            ("ApplicationClass", emit_tokens(certification.application_classes)),
            ("NetloadClass", certification.netload_class or None),
        )

    # submodules

    def _submodule(self, element: str, item: SubmoduleItem, usual: Numbers) -> None:
        if item.f_parameters is not None:
            raise ConfigError(f"the F parameters of {item.id} cannot be written, no model of this project has any")
        with self._inside(
            element,
            ("ID", item.id or None),
            ("SubmoduleIdentNumber", f"0x{item.ident:08X}"),
            _number("API", item.api, 0),
            _numbers("FixedInSubslots", item.fixed, usual),
            _numbers("Writeable_IM_Records", item.writeable_im),
            ("MayIssueProcessAlarm", str(item.may_issue_process_alarm).lower()),
            _flag("PROFIsafeSupported", item.profisafe),
        ):
            lengths = (_number("IOPS_Length", item.iops_length, 1), _number("IOCS_Length", item.iocs_length, 1))
            if item.inputs is None and item.outputs is None:
                self._element("IOData", *lengths)
            else:
                with self._inside("IOData", *lengths):
                    self._data("Input", item.inputs)
                    self._data("Output", item.outputs)
            self._records(item.records)
            self._info(item.info)

    def _data(self, direction: str, data: DataItems | None) -> None:
        if data is None:
            return
        with self._inside(direction, ("Consistency", "All items consistency" if data.whole else None)):
            for item in data.items:
                known = DATA_TYPE_OCTETS.get(item.data_type)
                if known not in {None, item.octets}:
                    raise ConfigError(f"a {item.data_type} of {item.octets} octets cannot be written, it has {known}")
                attributes = (
                    ("DataType", item.data_type),
                    ("Length", str(item.octets) if known is None else None),
                    _flag("UseAsBits", item.use_as_bits),
                    ("TextId", self._text_id(item.name)),
                )
                if not item.bits:
                    self._element("DataItem", *attributes)
                    continue
                with self._inside("DataItem", *attributes):
                    for bit, name in item.bits:
                        self._element("BitDataItem", _number("BitOffset", bit), ("TextId", self._text_id(name)))

    def _records(self, records: Sequence[ParameterRecord]) -> None:
        with self._list("RecordDataList"):
            for record in records:
                with self._inside(
                    "ParameterRecordDataItem",
                    _number("Index", record.index),
                    _number("Length", record.length),
                    _number("TransferSequence", record.transfer_sequence, 0),
                ):
                    self._named("Name", record.name)
                    for const in record.consts:
                        place = _number("ByteOffset", const.byte_offset, 0)
                        self._element("Const", place, ("Data", emit_octets(const.data)))
                    for ref in record.refs:
                        self._ref(ref)

    def _ref(self, ref: ParameterRef) -> None:
        self._element(
            "Ref",
            ("ValueItemTarget", self._values.setdefault(ref.texts, f"V{len(self._values) + 1}") if ref.texts else None),
            ("DataType", ref.data_type),
            _number("ByteOffset", ref.byte_offset),
            _number("BitOffset", ref.bit_offset, 0),
            _number("BitLength", ref.bit_length, 1),
            _number("Length", ref.length, 0),
            _text("DefaultValue", ref.default),
            _text("AllowedValues", ref.allowed),
            _flag("Changeable", ref.changeable, default=True),
            _flag("Visible", ref.visible, default=True),
            ("TextId", self._text_id(ref.name)),
        )

    def _value_list(self) -> None:
        with self._list("ValueList"):
            for texts, name in self._values.items():
                with self._inside("ValueItem", ("ID", name)), self._inside("Assignments"):
                    for content, text in texts:
                        self._element("Assign", ("TextId", self._text_id(text)), ("Content", content))

    def _port(self, port: PortSubmodule, *, pluggable: bool = False) -> None:
        with self._inside(
            "PortSubmoduleItem",
            ("ID", port.id or None),
            ("SubmoduleIdentNumber", f"0x{port.ident:08X}"),
            ("SubslotNumber", None if pluggable else str(port.subslot)),
            ("TextId", None if pluggable else self._text_id(port.name)),
            _number("MaxPortRxDelay", port.max_rx_delay, 0),
            _number("MaxPortTxDelay", port.max_tx_delay, 0),
            _numbers("Writeable_IM_Records", port.writeable_im),
        ):
            self._records(port.records)
            if pluggable:
                with self._inside("ModuleInfo"):
                    self._named("Name", port.name)
            with self._inside("MAUTypeList"):
                for value in port.mau_types:
                    self._element("MAUTypeItem", _number("Value", value))

    def _interface(self, interface: InterfaceSubmodule) -> None:
        with self._inside(
            "InterfaceSubmoduleItem",
            ("ID", interface.id or None),
            ("SubmoduleIdentNumber", f"0x{interface.ident:08X}"),
            ("SubslotNumber", str(interface.subslot)),
            ("TextId", self._text_id(interface.name)),
            ("SupportedRT_Classes", emit_tokens(interface.rt_classes)),
            # the schema requires it, even if empty
            ("SupportedProtocols", emit_tokens(interface.protocols)),
            _flag("NetworkComponentDiagnosisSupported", interface.network_component_diagnosis),
            _flag("DCP_HelloSupported", interface.dcp_hello),
            _flag("PTP_BoundarySupported", interface.ptp_boundary),
            _flag("DCP_BoundarySupported", interface.dcp_boundary),
            _numbers("Writeable_IM_Records", interface.writeable_im),
        ):
            self._records(interface.records)
            self._relations(interface.relations)

    def _relations(self, relations: Relations) -> None:
        with self._inside(
            "ApplicationRelations",
            ("StartupMode", emit_tokens(relations.startup_modes)),
            _number("NumberOfAdditionalInputCR", relations.additional_input_crs, 0),
            _number("NumberOfAdditionalOutputCR", relations.additional_output_crs, 0),
            _number("NumberOfAR", relations.number_of_ars, 1),
            _flag("PullModuleAlarmSupported", relations.pull_module_alarm),
        ):
            self._element(
                "TimingProperties",
                _listed("SendClock", relations.send_clocks, DEFAULT_SEND_CLOCKS),
                _listed("ReductionRatio", relations.ratios, DEFAULT_RATIOS),
            )

    def _diagnoses(self, diagnoses: Sequence[ChannelDiagnosis]) -> None:
        with self._list("ChannelDiagList"):
            for diagnosis in diagnoses:
                element = "ChannelDiagItem" if diagnosis.api is None else "ProfileChannelDiagItem"
                if diagnosis.is_standard:
                    element = "SystemDefinedChannelDiagItem"
                severities = _severities(diagnosis.severities)
                with self._inside(element, _api(diagnosis.api), _number("ErrorType", diagnosis.error_type), severities):
                    if not diagnosis.is_standard:
                        self._named_with_help(diagnosis.name, diagnosis.help)
                    with self._list("ExtChannelDiagList"):
                        for ext in diagnosis.extended:
                            item = ("" if ext.error_type < PROFILE_TYPES else "Profile") + "ExtChannelDiagItem"
                            with self._inside(item, _number("ErrorType", ext.error_type), _severities(ext.severities)):
                                self._named_with_help(ext.name, ext.help)

    def _unit_diagnoses(self, diagnoses: Sequence[UnitDiagnosis]) -> None:
        with self._list("UnitDiagTypeList"):
            for diagnosis in diagnoses:
                element = "UnitDiagTypeItem" if diagnosis.api is None else "ProfileUnitDiagTypeItem"
                usi = _number("UserStructureIdentifier", diagnosis.user_structure)
                with self._inside(element, _api(diagnosis.api), usi):
                    self._named_with_help(diagnosis.name, diagnosis.help)
                    for ref in diagnosis.fields:
                        self._ref(ref)

    def _named_with_help(self, name: str, text: str) -> None:
        self._named("Name", name)
        if text:
            self._named("Help", text)


def _written(attributes: Iterable[Attribute]) -> str:
    return "".join(f" {name}={quoted(value)}" for name, value in attributes if value is not None)


def emit_gsdml(gsdml: Gsdml) -> str:
    """The file's text, to be stored as UTF-8.

    Raises :class:`ConfigError` for a datum whose type and length contradict each other, and for F parameters.
    """
    return _Writer().write(gsdml)
