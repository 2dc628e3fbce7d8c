"""The GSDML description of a drive model: what its virtual device supports, and nothing else.

Schema V2.35: TIA Portal accepts it since V15.1.  The file needs no feature beyond V2.3, and the DAP says PNIO_Version
V2.3: from V2.31 on tools ask for PTP and DCP boundaries, which this device does not have.

What a file of this format cannot express: which send clock goes with which reduction ratio.  A device with a slowest
cycle refuses the pairs that exceed it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.axis_slots import axis_shifts
from pnfarm.buses.profinet.binding import AxisPlace, describe_device
from pnfarm.buses.profinet.controller.identity import revision_text
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.dcp.rules import RESET_MODES
from pnfarm.protocols.profinet.gsdml.document import (
    NO_NUMBERS,
    PROFILE_TYPES,
    Certification,
    ChannelDiagnosis,
    Dap,
    DataItem,
    DataItems,
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
from pnfarm.protocols.profinet.gsdml.records import ParameterRef
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import PROFIDRIVE_API, PROFIDRIVE_ERROR_TYPES
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import DescriptionFile, Fault
    from pnfarm.drives.telegrams.telegram import Signal, Telegram
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription, SubmoduleDescription

__all__ = [
    "MAU_100_FULL", "PNIO_VERSION", "PROTOCOLS", "RESETS", "SCHEMA_VERSION", "describe_diagnosis",
    "describe_model", "dns_name", "file_name",
]  # fmt: skip

SCHEMA_VERSION = "V2.35"
PNIO_VERSION = "V2.3"

#: The classes of what the virtual device does; the lowest for net load, which is not tested (assumed: no
#: manual names classes).
_CERTIFICATION = Certification("B", (), "I")
#: 100BASE-TX full duplex (MAU type of IETF RFC 4836).
MAU_100_FULL = 16
_INTERFACE_SUBSLOT = 0x8000


#: Capabilities of a farm's device outside its description, each of which a test compares with a station: protocols, and
#: modes of DCP's reset.  None sends DCP Hello unless its farm file says so.
PROTOCOLS = ("SNMP", "LLDP")
RESETS = Numbers.of(sorted(RESET_MODES))


def dns_name(text: str) -> str:
    """A name of a station made of any text; empty if nothing of it can be one."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:60].strip("-")


def _hex(value: int) -> str:
    return f"{value:X}"


# IO data


def _data_type(model: Model, signal: Signal) -> str:
    """By the signal's length; signed where it, or the parameter of the same name, is."""
    if signal.real:
        return f"Float{signal.bits}"
    pnu = model.parameter_names.get(signal.name)
    signed = signal.signed or (pnu is not None and model.parameters[pnu].signed)
    return f"{'Integer' if signed else 'Unsigned'}{signal.bits}"


def _items(model: Model, signals: Iterable[Signal | None]) -> DataItems | None:
    """The data of one direction; a double word is in ``signals`` twice and is one item."""
    items: list[DataItem] = []
    words = list(signals)
    position = 0
    while position < len(words):
        signal = words[position]
        if signal is None:
            items.append(DataItem("Unsigned16", 2, f"Word {position + 1}, without a signal"))
            position += 1
        else:
            items.append(DataItem(_data_type(model, signal), signal.bits // 8, signal.name))
            position += signal.bits // 16
    return DataItems(tuple(items), whole=True) if items else None


def _free(octets: int) -> DataItems | None:
    """Words whose meaning a parameter decides."""
    items = tuple(DataItem("Unsigned16", 2, f"Word {number}") for number in range(1, octets // 2 + 1))
    return DataItems(items, whole=True) if items else None


def frame_octets(modules: Iterable[ModuleDescription]) -> tuple[int, int]:
    """Octets of the input and of the output frame for these modules with their status octets, without padding.

    Each datum has a provider status after it and a consumer status in the frame of the other direction; a submodule
    without data counts as one with inputs of no length (IEC 61158-6-10, ExpectedSubmoduleBlockReq).
    """
    inputs = outputs = 0
    for module in modules:
        for s in module.submodules:
            if s.input_bytes or not s.output_bytes:
                inputs += s.input_bytes + 1
                outputs += 1
            if s.output_bytes:
                outputs += s.output_bytes + 1
                inputs += 1
    return inputs, outputs


def _largest(description: DeviceDescription) -> tuple[int, int]:
    """The largest frames that any choice of modules makes."""
    sizes = list(frame_octets([description.dap]))
    for slot in description.slots[1:]:
        choices = [
            frame_octets([module.taking({one.subslot: one.submodule_ident for one in module.choices})])
            for module in description.modules
            if module.slot == slot
        ]
        sizes = [size + max(column) for size, column in zip(sizes, zip(*choices, strict=True), strict=True)]
    return sizes[0], sizes[1]


# timing


def _timing(description: DeviceDescription) -> tuple[Numbers, Numbers]:
    """Send clocks and reduction ratios; MinDeviceInterval gives the shortest cycle."""
    if 32 not in description.send_clocks:
        raise ConfigError(f"{description.station_type} has no send clock of 1 ms, which the format requires")
    return Numbers.of(description.send_clocks), Numbers.of(description.reduction_ratios)


# the parts


def _virtual(
    item_id: str,
    s: SubmoduleDescription,
    info: Info,
    inputs: DataItems | None = None,
    outputs: DataItems | None = None,
    *,
    im: Numbers | None = None,
) -> SubmoduleItem:
    return SubmoduleItem(
        id=item_id,
        ident=s.submodule_ident,
        info=info,
        api=s.api,
        fixed=Numbers.of([s.subslot]),
        inputs=inputs,
        outputs=outputs,
        writeable_im=NO_NUMBERS if im is None else im,
    )


def _telegram_id(telegram: Telegram, module: ModuleDescription) -> str:
    """The telegram's own module is named after its number; others add their ident."""
    plain = module.module_ident == telegram.module.ident
    return f"TELEGRAM_{telegram.number}" + ("" if plain else f"_MODULE_{_hex(module.module_ident)}")


def _telegram_module(model: Model, telegram: Telegram, module: ModuleDescription) -> ModuleItem:
    submodules = []
    item_id = _telegram_id(telegram, module)
    named = next((m.name for m in telegram.others if m.ident == module.module_ident), "") or telegram.name
    for s, data in zip(module.submodules, telegram.module.submodules, strict=True):
        inputs = outputs = None
        if s.input_bytes or s.output_bytes:
            free = telegram.free_mapping
            inputs = _free(s.input_bytes) if free else _items(model, telegram.input)
            outputs = _free(s.output_bytes) if free else _items(model, telegram.output)
        name = Info(data.name, f"Subslot {s.subslot}, API 0x{_hex(s.api)}")
        submodules.append(_virtual(f"{item_id}_{s.subslot}", s, name, inputs, outputs))
    octets = frame_octets([module])
    info = Info(
        named,
        f"{octets[0]} octets to the controller and {octets[1]} from it, with their status octets",
    )
    places = {telegram.module.data.subslot: telegram for telegram in model.profidrive.supplements.values()}
    return ModuleItem(
        item_id,
        module.module_ident,
        info,
        physical_subslots=Numbers.of(sorted({*places, *(one.subslot for one in module.submodules)} if places else ())),
        submodules=tuple(submodules),
        useable=tuple(ItemRef(_supplement_id(one), allowed=Numbers.of([place])) for place, one in places.items()),
    )


def _supplement_id(telegram: Telegram) -> str:
    return f"SUPPLEMENT_{telegram.number}"


def _supplement(model: Model, telegram: Telegram) -> SubmoduleItem:
    """A supplementary telegram, which can be plugged beside any other."""
    data = telegram.module.data
    octets = f"{data.output_bytes} octets out and {data.input_bytes} in, API 0x{_hex(data.api)}"
    return SubmoduleItem(
        _supplement_id(telegram),
        data.ident,
        Info(telegram.name, octets),
        api=data.api,
        inputs=_items(model, telegram.input),
        outputs=_items(model, telegram.output),
    )


def _system(
    model: Model, description: DeviceDescription
) -> tuple[tuple[InterfaceSubmodule, ...], tuple[PortSubmodule, ...]]:
    """The interfaces and ports among the DAP's submodules."""
    clocks, ratios = _timing(description)
    interfaces, ports = [], []
    for s, data in zip(description.dap.submodules, model.dap.submodules, strict=True):
        if s.subslot < _INTERFACE_SUBSLOT:
            continue
        item_id = f"DAP_{_hex(s.subslot)}"
        if s.subslot & 0xFF:
            ports.append(PortSubmodule(item_id, s.submodule_ident, s.subslot, data.name, Numbers.of([MAU_100_FULL])))
            continue
        interfaces.append(
            InterfaceSubmodule(
                id=item_id,
                ident=s.submodule_ident,
                subslot=s.subslot,
                name=data.name,
                protocols=PROTOCOLS,
                relations=Relations(
                    startup_modes=("Legacy", "Advanced"),
                    number_of_ars=description.limits.max_ars,
                    send_clocks=clocks,
                    ratios=ratios,
                ),
            )
        )
    return tuple(interfaces), tuple(ports)


def _dap(model: Model, description: DeviceDescription, info: Info) -> Dap:
    interfaces, ports = _system(model, description)
    largest = _largest(description)
    im0 = description.im0
    im = Numbers.of(number for number in range(1, 5) if im0.im_supported >> number & 1)
    default = {slot: description.default_module(slot) for slot in description.slots}
    shifts = _shifts(model)
    return Dap(
        id="DAP",
        ident=description.dap.module_ident,
        info=info,
        pnio_version=PNIO_VERSION,
        required_schema_version=PNIO_VERSION,
        physical_slots=Numbers.of(description.slots),
        fixed_slots=Numbers.of([description.dap.slot]),
        min_device_interval=max(1, description.min_cycle_ns // SEND_CLOCK_NS),
        implementation_type="pnfarm",
        dns_name=dns_name(model.name) or "drive",
        instance=description.instance,
        multiple_write=True,
        device_access=description.limits.max_device_access_ars > 0,
        device_access_ars=description.limits.max_device_access_ars,
        # a second controller gets the submodules that the first one does not hold
        shared_device=description.limits.max_ars > 1,
        check_device_id=True,
        lldp_nod=True,
        reset_modes=RESETS,
        max_input=largest[0],
        max_output=largest[1],
        certification=_CERTIFICATION,
        modules=tuple(
            ItemRef(
                _telegram_id(telegram, module),
                allowed=Numbers.of([telegram.module.slot + shift for shift in shifts]),
                used=Numbers.of([telegram.module.slot] if default[telegram.module.slot] == module else []),
            )
            for telegram, module in _telegrams(model, description)
        ),
        submodules=tuple(
            _virtual(f"DAP_{_hex(s.subslot)}", s, Info(data.name, info.info_text), im=im if place == 0 else None)
            for place, (s, data) in enumerate(zip(description.dap.submodules, model.dap.submodules, strict=True))
            if s.subslot < _INTERFACE_SUBSLOT
        ),
        interfaces=interfaces,
        ports=ports,
    )


def _shifts(model: Model) -> list[int]:
    """How far after the first axis the slots of each axis of the model are."""
    return axis_shifts(model, [None] * model.limits.axes)


def _telegrams(model: Model, description: DeviceDescription) -> list[tuple[Telegram, ModuleDescription]]:
    """Each telegram with the modules that the device has for it, by number."""
    found = []
    for _, telegram in sorted(model.profidrive.telegrams.items()):
        for known in telegram.modules:
            module = description.module(known.slot, known.ident)
            assert module is not None  # the description is made of these telegrams
            found.append((telegram, module))
    return found


# diagnosis


def describe_diagnosis(model: Model) -> tuple[tuple[ChannelDiagnosis, ...], tuple[UnitDiagnosis, ...]]:
    """The diagnoses with which the drive reports its own faults.

    The extended form of a fault has ExtChannelErrorType 0, for which a file cannot have an entry: the help explains its
    value.
    """
    if not model.limits.alarms:
        return (), ()
    coding = model.diagnosis_coding
    faults: dict[int, list[Fault]] = {}
    for number, error_type in sorted(model.diagnoses.items()):
        faults.setdefault(error_type, []).append(model.faults[number])
    value = ". Value: error location and number" if coding is not None and "extended" in coding.modes else ""
    api = model.profidrive.telegrams[model.profidrive.default_telegram].module.submodules[0].api
    channels = []
    for error_type, told in sorted(faults.items()):
        known = PROFIDRIVE_ERROR_TYPES.get(error_type, "") if api == PROFIDRIVE_API else ""
        channels.append(
            ChannelDiagnosis(
                error_type,
                known[:1].upper() + known[1:] or "; ".join(fault.name for fault in told),
                "; ".join(f"{fault.label} {fault.name}" for fault in told) + value,
                api=api if error_type >= PROFILE_TYPES else None,
            )
        )
    if coding is None or "manufacturer" not in coding.modes:
        return tuple(channels), ()
    fields, offset = [], 0
    for name, octets in zip(coding.user_fields, coding.user_octets, strict=True):
        fields.append(ParameterRef(f"Unsigned{octets * 8}", byte_offset=offset, default="0", name=name))
        offset += octets
    return tuple(channels), (UnitDiagnosis(coding.user_structure, "Fault of the drive", fields=tuple(fields)),)


def describe_model(model: Model) -> Gsdml:
    """The description of a drive of this model with strict limits.

    Raises :class:`ConfigError` for a model of another bus, and for one without texts for such a file.
    """
    file = _texts(model)
    # the MAC address makes only the serial number, which such a file does not hold
    description = describe_device(model, bytes(6), strict=True, axes=[AxisPlace(shift) for shift in _shifts(model)])
    im0 = description.im0
    info = Info(
        name=model.title,
        info_text=file.info_text,
        vendor_name=model.maker,
        order_number=im0.order_id,
        hardware_release=str(im0.hardware_revision),
        software_release=revision_text(im0.software_revision),
    )
    diagnoses, unit_diagnoses = describe_diagnosis(model)
    supplements = tuple(_supplement(model, telegram) for telegram in model.profidrive.supplements.values())
    modules = [_telegram_module(model, telegram, module) for telegram, module in _telegrams(model, description)]
    return Gsdml(
        vendor_id=description.vendor_id,
        device_id=description.device_id,
        vendor_name=model.maker,
        info_text=file.info_text,
        main_family="Drives",
        product_family=file.family,
        schema_version=SCHEMA_VERSION,
        daps=(_dap(model, description, info),),
        modules=tuple(modules),
        submodules=supplements,
        diagnoses=diagnoses,
        unit_diagnoses=unit_diagnoses,
    )


def _texts(model: Model) -> DescriptionFile:
    if model.bus != "profinet":
        raise ConfigError(f"{model.name} is a drive for {model.bus}, a GSDML file describes one for profinet")
    if model.description_file is None:
        raise ConfigError(f"{model.name} has no section description_file, a GSDML file needs its texts")
    return model.description_file


def file_name(model: Model) -> str:
    """Name of the file by the format's convention: schema version, vendor, device, day.

    The vendor's part is this project's name, so that the file never takes the place of the maker's own.
    """
    name = re.sub(r"[^A-Za-z0-9-]", "-", model.name)
    return f"GSDML-{SCHEMA_VERSION}-pnfarm-{name}-{_texts(model).date}.xml"
