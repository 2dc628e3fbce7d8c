"""The GSDML description of a device that a capture shows: what was seen of it, and nothing else.

Data are octets, as no frame says more.  The one access point has the module of the first interface's slot; a module
is an entry for each ident, or several where the same ident has other submodules, records or I&M data elsewhere.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.controller.identity import revision_text
from pnfarm.buses.profinet.model_gsdml import MAU_100_FULL, PNIO_VERSION, PROTOCOLS, RESETS, SCHEMA_VERSION, dns_name
from pnfarm.buses.profinet.seen_device import SYSTEM, is_interface
from pnfarm.protocols.profinet.gsdml.document import (
    DEFAULT_RATIOS,
    DEFAULT_SEND_CLOCKS,
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
)
from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.values import Numbers, emit_octets
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.protocols.profinet.wire.cm.iocr import MAX_C_SDU, IocrType
from pnfarm.vocabulary.quoting import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pnfarm.buses.profinet.decode.observed import SeenConnection, SeenStation
    from pnfarm.buses.profinet.seen_device import SeenDevice, SeenModule, SeenSubmodule
    from pnfarm.protocols.profinet.wire.records.identification import Im0

__all__ = ["describe_seen", "file_name"]

_ACCESS_POINT = "DAP"
_NS = 1_000_000_000
#: The end of the year 9999: a capture may have any time.
_LAST = 253_402_300_799
#: Controllers at a time; real devices have up to eight.
_MOST_CONTROLLERS = 16
_U16 = 0xFFFF
#: Characters of a text of the device.
_MOST_TEXT = 200


def _printable(text: str) -> str:
    return printable(text.strip()[:_MOST_TEXT])


def describe_seen(seen: SeenStation, device: SeenDevice, connections: Sequence[SeenConnection]) -> Gsdml:
    """The file of this device; its modules are where they were seen."""
    vendor, number, instance = connections[-1].numbers
    slot = device.head
    items: dict[ModuleItem, Numbers] = {}
    for place, module in device.modules.items():
        if place != slot:
            item = _module(module, _Slot(place, device, seen))
            items[item] = Numbers.join((*items.get(item, Numbers()).ranges, (place, place)))
    modules = _named(items)
    family = _printable(seen.station_type)
    text = "Made from a capture: what a controller asked of this device and what it answered."
    return Gsdml(
        vendor_id=vendor,
        device_id=number,
        vendor_name=f"Vendor 0x{vendor:04X}",
        info_text=text,
        main_family="General",
        product_family=family,
        schema_version=SCHEMA_VERSION,
        daps=(
            replace(
                _dap(device.modules[slot], _Slot(slot, device, seen), family or f"Device 0x{number:04X}", connections),
                instance=instance,
                physical_slots=Numbers.of(device.modules),
                fixed_slots=Numbers.of([slot]),
                modules=tuple(ItemRef(item.id, allowed=places) for item, places in modules),
            ),
        ),
        modules=tuple(item for item, _ in modules),
    )


def file_name(time_ns: int) -> str:
    """Name of the file by the format's convention, with ``{name}`` for the station's, and the capture's day (UTC).

    The vendor's part is this project's name, so that the file never takes the place of the maker's own.
    """
    day = datetime.fromtimestamp(min(time_ns // _NS, _LAST), UTC)
    return f"GSDML-{SCHEMA_VERSION}-pnfarm-{{name}}-{day:%Y%m%d}.xml"


def _named(items: Mapping[ModuleItem, Numbers]) -> list[tuple[ModuleItem, Numbers]]:
    """The modules with IDs of their own, and their slots."""
    named, taken = [], dict[int, int]()
    for item, places in items.items():
        taken[item.ident] = number = taken.get(item.ident, 0) + 1
        own = f"M_{item.ident:08X}" + (f"_V{number}" if number > 1 else "")
        submodules = tuple(replace(one, id=f"{own}_{next(iter(one.fixed)):04X}") for one in item.submodules)
        ports = tuple(replace(one, id=f"{own}_{one.subslot:04X}") for one in item.ports)
        named.append((replace(item, id=own, submodules=submodules, ports=ports), places))
    return named


class _Slot:
    """What else is known of the submodules of one slot."""

    def __init__(self, slot: int, device: SeenDevice, seen: SeenStation) -> None:
        self._slot = slot
        self._parameters = device.parameters
        self.im0: Im0 | None = next((im0 for (place, _), im0 in sorted(seen.im0.items()) if place == slot), None)

    def records(self, subslot: int) -> tuple[ParameterRecord, ...]:
        """Each as one value, which has the captured octets."""
        return tuple(
            ParameterRecord(
                index,
                len(data),
                name,
                refs=(ParameterRef("OctetString", length=len(data), default=emit_octets(data), name=name),),
            )
            for index, data in self._parameters.get((self._slot, subslot), {}).items()
            for name in [f"Record {index}"]
        )

    def info(self, name: str) -> Info:
        if self.im0 is None:
            return Info(name, name)
        return Info(
            name,
            name,
            order_number=_printable(self.im0.order_id.decode("ascii", "replace")),
            hardware_release=str(self.im0.hardware_revision),
            software_release=_printable(revision_text(self.im0.software_revision)),
        )


def _module(module: SeenModule, slot: _Slot) -> ModuleItem:
    return ModuleItem(
        "",
        module.ident,
        slot.info(f"Module 0x{module.ident:08X}"),
        submodules=tuple(_virtual(module, slot, within_head=False)),
        ports=tuple(_ports(module, slot)),
    )


def _dap(head: SeenModule, slot: _Slot, name: str, connections: Sequence[SeenConnection]) -> Dap:
    iocrs = [iocr for connection in connections for iocr in connection.iocrs]
    controllers = min(_MOST_CONTROLLERS, len({connection.controller for connection in connections}))
    inputs, outputs = (_most(connections, iocr_type) for iocr_type in (IocrType.INPUT, IocrType.OUTPUT))
    relations = Relations(
        startup_modes=tuple(
            mode
            for mode, advanced in (("Legacy", False), ("Advanced", True))
            if any(connection.advanced is advanced for connection in connections)
        ),
        number_of_ars=controllers,
        additional_input_crs=inputs - 1,
        additional_output_crs=outputs - 1,
        send_clocks=Numbers.of((*DEFAULT_SEND_CLOCKS, *(iocr.send_clock_factor for iocr in iocrs))),
        ratios=Numbers.of((*DEFAULT_RATIOS, *(iocr.reduction_ratio for iocr in iocrs))),
    )
    interfaces = [
        InterfaceSubmodule(
            f"{_ACCESS_POINT}_{subslot:04X}",
            one.ident,
            subslot,
            "Interface",
            protocols=PROTOCOLS,
            relations=relations,
            records=slot.records(subslot),
        )
        for subslot, one in head.submodules.items()
        if is_interface(subslot) and _is_system(subslot, one)
    ]
    # no frame says what the device takes, which is at least the modules of all connections
    longest = min(_U16, MAX_C_SDU * len(connections) * max(inputs, outputs))
    discards = SubmoduleProperties.DISCARD_IOXS
    return Dap(
        id=_ACCESS_POINT,
        ident=head.ident,
        info=slot.info(name),
        pnio_version=PNIO_VERSION,
        required_schema_version=PNIO_VERSION,
        min_device_interval=min(_U16, *(iocr.send_clock_factor * iocr.reduction_ratio for iocr in iocrs)) or 1,
        implementation_type="pnfarm",
        dns_name=dns_name(name) or "device",
        multiple_write=True,
        ioxs_required=not any(
            one.properties & discards for connection in connections for api in connection.apis for one in api.submodules
        ),
        device_access=True,
        device_access_ars=1,
        shared_device=controllers > 1,
        check_device_id=True,
        lldp_nod=True,
        reset_modes=RESETS,
        max_input=longest,
        max_output=longest,
        submodules=tuple(
            replace(one, id=f"{_ACCESS_POINT}_{next(iter(one.fixed)):04X}")
            for one in _virtual(head, slot, within_head=True)
        ),
        interfaces=tuple(interfaces),
        ports=tuple(replace(one, id=f"{_ACCESS_POINT}_{one.subslot:04X}") for one in _ports(head, slot)),
        own_relations=None if interfaces else relations,
    )


def _most(connections: Sequence[SeenConnection], iocr_type: IocrType) -> int:
    """CRs of a direction that a connection has at most."""
    return max(1, *(sum(iocr.iocr_type == iocr_type for iocr in one.iocrs) for one in connections))


def _is_system(subslot: int, one: SeenSubmodule) -> bool:
    """An interface or a port, as a file can have them: without data, in API 0."""
    return subslot in SYSTEM and not one.inputs and not one.outputs and not one.api


def _ports(module: SeenModule, slot: _Slot) -> Iterator[PortSubmodule]:
    for subslot, one in module.submodules.items():
        if _is_system(subslot, one) and not is_interface(subslot):
            mau, number = Numbers.of([MAU_100_FULL]), subslot & 0xFF
            yield PortSubmodule("", one.ident, subslot, f"Port {number}", mau, records=slot.records(subslot))


def _virtual(module: SeenModule, slot: _Slot, *, within_head: bool) -> Iterator[SubmoduleItem]:
    """All others; an interface of another module than the access point's is among them."""
    for subslot, one in module.submodules.items():
        if _is_system(subslot, one) and (within_head or not is_interface(subslot)):
            continue
        name = f"Submodule 0x{one.ident:08X}"
        yield SubmoduleItem(
            "",
            one.ident,
            Info(name, f"Subslot 0x{subslot:04X}, API 0x{one.api:X}"),
            api=one.api,
            fixed=Numbers.of([subslot]),
            inputs=_octets(one.inputs),
            outputs=_octets(one.outputs),
            records=slot.records(subslot),
        )


def _octets(count: int) -> DataItems | None:
    items = tuple(DataItem("Unsigned8", 1, f"Octet {number}") for number in range(count))
    return DataItems(items, whole=True) if items else None
