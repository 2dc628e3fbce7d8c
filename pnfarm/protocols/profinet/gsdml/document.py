"""What a GSDML file says, as data: :class:`Gsdml` and what it is made of.

Attributes carry the file's names in this project's spelling; what a file leaves out has the default of its schema
version (`versions`).  Texts are those of the primary language; ``Gsdml.languages`` has the others.  ``line`` is the
element's in the file, 0 in a description that was not read.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.gsdml.languages import Languages
from pnfarm.protocols.profinet.gsdml.values import Numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef

__all__ = [
    "DATA_TYPE_OCTETS",
    "DEFAULT_RATIOS",
    "DEFAULT_SEND_CLOCKS",
    "FIRST_SUBSLOT",
    "NO_NUMBERS",
    "PROFILE_TYPES",
    "Certification",
    "ChannelDiagnosis",
    "Dap",
    "DataItem",
    "DataItems",
    "ExtDiagnosis",
    "Gsdml",
    "Info",
    "InterfaceSubmodule",
    "ItemRef",
    "ModuleItem",
    "PortSubmodule",
    "Relations",
    "SubmoduleItem",
    "UnitDiagnosis",
]

#: Octets of the types that a DataItem may have; the others carry a Length.
DATA_TYPE_OCTETS = {
    "Boolean": 1,
    "Integer8": 1,
    "Integer16": 2,
    "Integer32": 4,
    "Integer64": 8,
    "Unsigned8": 1,
    "Unsigned16": 2,
    "Unsigned32": 4,
    "Unsigned64": 8,
    "Float32": 4,
    "Float64": 8,
    "Date": 7,
    "TimeOfDay with date indication": 6,
    "TimeOfDay without date indication": 4,
    "TimeDifference with date indication": 6,
    "TimeDifference without date indication": 4,
    "NetworkTime": 8,
    "NetworkTimeDifference": 8,
    "N2": 2,
    "N4": 4,
    "V2": 2,
    "L2": 2,
    "R2": 2,
    "T2": 2,
    "T4": 4,
    "D2": 2,
    "E2": 2,
    "C4": 4,
    "X2": 2,
    "X4": 4,
    "Unipolar2.16": 2,
    "Float32+Unsigned8": 5,
    "Float32+Status8": 5,
    "Unsigned8+Unsigned8": 2,
    "F_MessageTrailer4Byte": 4,
    "F_MessageTrailer5Byte": 5,
    "TimeStamp": 12,
    "TimeStampDifference": 12,
    "TimeStampDifferenceShort": 8,
    "OctetString2+Unsigned8": 3,
    "Unsigned8_S": 1,
    "Unsigned16_S": 2,
    "Integer16_S": 2,
}

NO_NUMBERS = Numbers()
#: Subslot of a virtual submodule that names none.
FIRST_SUBSLOT = Numbers.of([1])
#: SendClock and ReductionRatio where the file names none.
DEFAULT_SEND_CLOCKS = Numbers.of([32])
DEFAULT_RATIOS = Numbers.of([1, 2, 4, 8, 16, 32, 64, 128, 256, 512])
#: CRs of one direction of a connection that a farm's tables have rows for.
MAX_CRS = 8
#: From here on an ExtChannelErrorType is a profile's.
PROFILE_TYPES = 0x9000


@dataclass(frozen=True, slots=True)
class Info:
    """ModuleInfo: texts about a module or a submodule."""

    name: str = ""
    info_text: str = ""
    vendor_name: str = ""
    order_number: str = ""
    hardware_release: str = ""
    software_release: str = ""


@dataclass(frozen=True, slots=True)
class DataItem:
    """One datum of a submodule's inputs or outputs; ``octets`` follow from type and length; ``bits`` are the numbers
    and names of its BitDataItems."""

    data_type: str
    octets: int
    name: str = ""
    use_as_bits: bool = False
    bits: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class DataItems:
    """The inputs or the outputs of a submodule; ``whole`` is consistency over all items."""

    items: tuple[DataItem, ...] = ()
    whole: bool = False

    @property
    def octets(self) -> int:
        return sum(item.octets for item in self.items)


@dataclass(frozen=True, slots=True)
class SubmoduleItem:
    """A virtual submodule (``fixed`` names its subslots, and nothing refers to its ID), or one of the pluggable ones.

    ``inputs`` go to the controller, ``outputs`` come from it; None: the element is missing.
    """

    id: str
    ident: int
    info: Info = Info()
    api: int = 0
    fixed: Numbers = FIRST_SUBSLOT
    inputs: DataItems | None = None
    outputs: DataItems | None = None
    iops_length: int = 1
    iocs_length: int = 1
    records: tuple[ParameterRecord, ...] = ()
    may_issue_process_alarm: bool = False
    writeable_im: Numbers = NO_NUMBERS
    profisafe: bool = False
    f_parameters: ParameterRecord | None = None
    line: int = field(default=0, compare=False)

    @property
    def input_octets(self) -> int:
        return self.inputs.octets if self.inputs else 0

    @property
    def output_octets(self) -> int:
        return self.outputs.octets if self.outputs else 0


@dataclass(frozen=True, slots=True)
class ItemRef:
    """Places of a module or submodule (``target`` is its ID): anywhere in ``allowed``; ``used`` at the start of a
    project; ``fixed`` always."""

    target: str
    allowed: Numbers = NO_NUMBERS
    used: Numbers = NO_NUMBERS
    fixed: Numbers = NO_NUMBERS
    line: int = field(default=0, compare=False)

    def takes(self, place: int) -> bool:
        return place in self.allowed or place in self.fixed or place in self.used


@dataclass(frozen=True, slots=True)
class PortSubmodule:
    """A port of an interface; a built-in one may have no ID, as all before V2.25."""

    id: str
    ident: int
    subslot: int
    name: str = ""
    mau_types: Numbers = NO_NUMBERS
    max_rx_delay: int = 0
    max_tx_delay: int = 0
    records: tuple[ParameterRecord, ...] = ()
    writeable_im: Numbers = NO_NUMBERS


@dataclass(frozen=True, slots=True)
class Relations:
    """ApplicationRelations: how connections start, how many there are, and their cycles, send clocks in 31.25 us.

    ``additional_input_crs`` and ``additional_output_crs`` are those of one connection beside the first ones.
    """

    startup_modes: tuple[str, ...] = ("Legacy",)
    number_of_ars: int = 1
    additional_input_crs: int = 0
    additional_output_crs: int = 0
    pull_module_alarm: bool = False
    send_clocks: Numbers = DEFAULT_SEND_CLOCKS
    ratios: Numbers = DEFAULT_RATIOS

    @property
    def input_crs(self) -> int:
        """CRs that one connection may have to the controller: as many as a farm uses of those that the file names."""
        return min(MAX_CRS, 1 + self.additional_input_crs)

    @property
    def output_crs(self) -> int:
        """The same from the controller."""
        return min(MAX_CRS, 1 + self.additional_output_crs)

    @property
    def crs(self) -> int:
        """Those of the direction that has more."""
        return max(self.input_crs, self.output_crs)


@dataclass(frozen=True, slots=True)
class InterfaceSubmodule:
    """An interface; before V2.25 it has no ID."""

    id: str
    ident: int
    subslot: int = 0x8000
    name: str = ""
    rt_classes: tuple[str, ...] = ("RT_CLASS_1",)
    protocols: tuple[str, ...] = ()
    dcp_hello: bool = False
    ptp_boundary: bool = False
    dcp_boundary: bool = False
    network_component_diagnosis: bool = False
    relations: Relations = Relations()
    records: tuple[ParameterRecord, ...] = ()
    writeable_im: Numbers = NO_NUMBERS


@dataclass(frozen=True, slots=True)
class ModuleItem:
    """A module of the ModuleList; ``physical_subslots`` take the submodules of ``useable``."""

    id: str
    ident: int
    info: Info = Info()
    physical_subslots: Numbers = NO_NUMBERS
    submodules: tuple[SubmoduleItem, ...] = ()
    ports: tuple[PortSubmodule, ...] = ()
    useable: tuple[ItemRef, ...] = ()


@dataclass(frozen=True, slots=True)
class Certification:
    """CertificationInfo: conformance class (A, B, C), application classes, netload class (I, II, III); empty for none.

    What a file says of itself here needs no certificate.
    """

    conformance_class: str = ""
    application_classes: tuple[str, ...] = ()
    netload_class: str = ""


@dataclass(frozen=True, slots=True)
class Dap:
    """A device access point.  ``min_device_interval`` counts 31.25 us; ``instance`` is ObjectUUID_LocalIndex;
    ``max_input`` and ``max_output`` are octets of a frame with their status octets; ``application_seconds`` is
    RemoteApplicationTimeout, 0 where the file does not name it; ``own_relations`` are those of V1.0, which has no
    interfaces."""

    id: str
    ident: int
    info: Info = Info()
    pnio_version: str = ""
    required_schema_version: str = "V1.0"
    physical_slots: Numbers = NO_NUMBERS
    fixed_slots: Numbers = NO_NUMBERS
    allowed_slots: Numbers = NO_NUMBERS
    physical_subslots: Numbers = NO_NUMBERS
    min_device_interval: int = 32
    implementation_type: str = ""
    dns_name: str = ""
    instance: int = 1
    multiple_write: bool = False
    application_seconds: int = 0
    ioxs_required: bool = True
    device_access: bool = False
    device_access_ars: int = 0
    shared_device: bool = False
    shared_input: bool = False
    check_device_id: bool = False
    name_not_transferable: bool = False
    lldp_nod: bool = False
    reset_modes: Numbers = NO_NUMBERS
    address_assignment: tuple[str, ...] = ("DCP",)
    max_record: int = 4068
    max_input: int = 0
    max_output: int = 0
    max_data: int = 0
    certification: Certification | None = None
    modules: tuple[ItemRef, ...] = ()
    submodules: tuple[SubmoduleItem, ...] = ()
    interfaces: tuple[InterfaceSubmodule, ...] = ()
    ports: tuple[PortSubmodule, ...] = ()
    useable: tuple[ItemRef, ...] = ()
    own_relations: Relations | None = None

    @property
    def slot(self) -> int:
        """The DAP's slot unless another is chosen."""
        return next(iter(chain(self.fixed_slots, self.allowed_slots)), 0)

    @property
    def relations(self) -> Relations:
        """Those of its first interface, else its own; what the schema says where there are none."""
        return self.interfaces[0].relations if self.interfaces else self.own_relations or Relations()


@dataclass(frozen=True, slots=True)
class ExtDiagnosis:
    """An ExtChannelErrorType and what it means; from 0x9000 on it is a profile's."""

    error_type: int
    name: str
    help: str = ""
    severities: tuple[str, ...] = ("D",)


@dataclass(frozen=True, slots=True)
class ChannelDiagnosis:
    """A ChannelErrorType and what it means; ``api`` is that of the profile which it belongs to, None for the maker's.

    ``extended`` are in rising order.  ``severities`` is MaintenanceAlarmState: D (diagnosis), MR (maintenance
    required), MD (maintenance demanded), QD (qualified).
    """

    error_type: int
    name: str
    help: str = ""
    api: int | None = None
    extended: tuple[ExtDiagnosis, ...] = ()
    severities: tuple[str, ...] = ("D",)

    @property
    def is_standard(self) -> bool:
        """One that the standard defines, to which the file only adds: it has no texts of its own."""
        return self.api is None and not self.name and not self.help and self.severities == ("D",)


@dataclass(frozen=True, slots=True)
class UnitDiagnosis:
    """Diagnosis in a form of the maker's or (``api``) a profile's own: its USI, and what its octets mean."""

    user_structure: int
    name: str
    help: str = ""
    fields: tuple[ParameterRef, ...] = ()
    api: int | None = None


@dataclass(frozen=True, slots=True)
class Gsdml:
    """A whole file.  ``schema_version`` is such as ``V2.35``, empty when the file names none; ``remarks`` are about
    what its version asks for and it lacks."""

    vendor_id: int
    device_id: int
    vendor_name: str
    info_text: str = ""
    main_family: str = ""
    product_family: str = ""
    schema_version: str = ""
    daps: tuple[Dap, ...] = ()
    modules: tuple[ModuleItem, ...] = ()
    submodules: tuple[SubmoduleItem, ...] = ()
    pluggable_ports: tuple[PortSubmodule, ...] = ()
    diagnoses: tuple[ChannelDiagnosis, ...] = ()
    unit_diagnoses: tuple[UnitDiagnosis, ...] = ()
    languages: Languages = field(default=Languages(), compare=False)
    remarks: tuple[str, ...] = field(default=(), compare=False)

    def module(self, wanted: str) -> ModuleItem | None:
        return next((m for m in self.modules if m.id == wanted), None)

    def submodule(self, wanted: str) -> SubmoduleItem | None:
        """The pluggable submodule of this ID."""
        return next((s for s in self.submodules if s.id == wanted), None)

    def all_submodules(self) -> Iterator[SubmoduleItem]:
        """Every submodule that has IO data or records of its own, virtual and pluggable."""
        yield from self.submodules
        for dap in self.daps:
            yield from dap.submodules
        for module in self.modules:
            yield from module.submodules
