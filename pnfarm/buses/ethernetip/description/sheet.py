"""The electronic data sheet of a model (CIP volume 1, chapter 7-3; volume 2, chapter 7), from the model's data alone.

Sections of the standard's objects come from the objects themselves.  A parameter keeps its instance number as the
number of its entry; values are those on the wire, with the units in which the drive comes.
"""

from __future__ import annotations

from fractions import Fraction
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Final

from pnfarm.buses.ethernetip.description.parameters import parameter_entries
from pnfarm.buses.ethernetip.device.offers import connection_settings
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.connection import ConnectionKind, IoOffer
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.eds import bits
from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsSection, EdsString
from pnfarm.protocols.enip.objects.ethernet_link import EthernetLinkData, ethernet_link_object
from pnfarm.protocols.enip.objects.identity import IdentityData, identity_object
from pnfarm.protocols.enip.objects.qos import QosData, qos_object
from pnfarm.protocols.enip.objects.tcp_ip import TcpIpData, tcp_ip_object
from pnfarm.protocols.enip.wire.data_types import UDINT
from pnfarm.protocols.enip.wire.epath import ElectronicKey, Logical, LogicalSegment, emit_epath, logical_path

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.enip.eds.text import EdsField
    from pnfarm.protocols.enip.object import AttributeObject

__all__ = ["RPI_PARAMETER", "comments", "describe_model", "file_name"]

#: The day of the form of these files: they change with the model's data alone.
_DAY, _TIME, _REVISION = "11-23-2026", "12:00:00", "1.1"
#: Number of the entry with the limits of the packet interval: after every instance.
RPI_PARAMETER: Final = 60001
_DATA: Final = 3
#: Types by number (ODVA's list of device profiles).
_TYPES: Final = {
    0x02: "AC Drive",
    0x0C: "Communications Adapter",
    0x10: "Position Controller",
    0x25: "CIP Motion Drive",
}
_NS_PER_SECOND: Final = 1_000_000_000


def file_name(model: Model) -> str:
    """The project's name is a part of it, so that the file never takes the place of the maker's own."""
    product = Product.of(model)
    major, minor = product.revision
    return f"pnfarm-{model.name}-{product.vendor_id:04X}-{product.product_code:04X}-{major}.{minor}.eds"


def comments(model: Model) -> list[str]:
    """The file's head: what it describes, and what of it no manual says."""
    lines = [
        f"{model.title}: a virtual drive, described by pnfarm",
        f"after {model.manual}, edition {model.edition}. This is not the maker's file.",
        "",
        "Assumed, because no manual gives it:",
    ]
    lines += [f"  {key}: {fact.note}" for key, fact in model.bus_facts.items() if fact.source == "assumed"]
    rows = [row for row in model.cip.instances.values() if row.source == "assumed"]
    count = f"{len(rows)} of {len(model.cip.instances)}"
    lines.append(f"  number, name or size of {count} parameters: see pnfarm models {model.name}")
    return [line.encode("ascii", "replace").decode() for line in lines]


def describe_model(model: Model) -> Eds:
    """Raises :class:`ConfigError` for a model on another bus."""
    if model.bus != "ethernetip":
        raise ConfigError(f"{model.name} is a model on {model.bus}: an EDS file describes one on ethernetip")
    product = Product.of(model)
    return Eds(
        (
            _section("File", _file(model)),
            _section("Device", _device(model, product)),
            _section("Device Classification", [EdsEntry("Class1", ("EtherNetIP",))]),
            _section("Params", [*parameter_entries(model), _interval(product)]),
            _section("Assembly", _assemblies(product)),
            _section("Connection Manager", _connections(product)),
            _section("Capacity", _capacity(product)),
            *_standard_objects(product),
        )
    )


def _section(name: str, entries: Iterator[EdsEntry] | list[EdsEntry]) -> EdsSection:
    return EdsSection(name, tuple(entries))


def _text(value: str) -> EdsString:
    return EdsString(value.encode("ascii", "replace").decode())


def _path(*segments: LogicalSegment) -> EdsString:
    return EdsString(emit_epath(segments).hex(" ").upper())


def _file(model: Model) -> Iterator[EdsEntry]:
    yield EdsEntry("DescText", (_text(f"{model.title}, virtual drive of pnfarm"),))
    yield EdsEntry("CreateDate", (_DAY,))
    yield EdsEntry("CreateTime", (_TIME,))
    yield EdsEntry("Revision", (_REVISION,))


def _device(model: Model, product: Product) -> Iterator[EdsEntry]:
    yield EdsEntry("VendCode", (str(product.vendor_id),))
    yield EdsEntry("VendName", (_text(model.maker),))
    yield EdsEntry("ProdType", (str(product.device_type),))
    yield EdsEntry("ProdTypeStr", (_text(_TYPES.get(product.device_type, f"Type {product.device_type}")),))
    yield EdsEntry("ProdCode", (str(product.product_code),))
    yield EdsEntry("MajRev", (str(product.revision[0]),))
    yield EdsEntry("MinRev", (str(product.revision[1]),))
    yield EdsEntry("ProdName", (_text(product.product_name),))
    yield EdsEntry("Catalog", (_text(product.product_name),))


def _settings(product: Product) -> tuple[IoOffer, ...]:
    return connection_settings(product, ElectronicKey(), IPv4Address(0), strict=True).offers


def _interval(product: Product) -> EdsEntry:
    """Limits of the packet interval, in microseconds."""
    settings = connection_settings(product, ElectronicKey(), IPv4Address(0), strict=True)
    lowest = settings.minimum_rpi_us
    fields: list[EdsField] = [
        "0", "", "", "0x0000", f"0x{UDINT.code:02X}", str(UDINT.size), EdsString("RPI"), EdsString("us"),
        EdsString("Requested packet interval"), str(lowest), str(settings.maximum_rpi_us), str(lowest),
        *[""] * 8, "0",
    ]  # fmt: skip
    return EdsEntry(f"Param{RPI_PARAMETER}", tuple(fields))


def _assemblies(product: Product) -> Iterator[EdsEntry]:
    for name, number, octets in (
        ("Configuration", product.configuration_assembly, product.configuration_size),
        ("Command", product.output_assembly, product.output_size),
        ("Response", product.input_assembly, product.input_size),
    ):
        path = _path(*logical_path(ASSEMBLY, number, _DATA))
        yield EdsEntry(f"Assem{number}", (EdsString(name), path, str(octets), "0x0000", "", ""))


def _connections(product: Product) -> Iterator[EdsEntry]:
    for place, offer in enumerate(_settings(product), 1):
        output = bits.HEADER if product.output_run_idle else bits.MODELESS
        output = output if offer.consumed_octets else bits.HEARTBEAT
        parameters = bits.FIXED_OUTPUTS | bits.FIXED_INPUTS | output << bits.OUTPUT_FORMAT | bits.PRIORITIES
        parameters |= bits.OUTPUT_POINT_TO_POINT | bits.INPUT_MULTICAST
        parameters |= (bits.HEADER if product.input_run_idle else bits.MODELESS) << bits.INPUT_FORMAT
        if offer.kind is not ConnectionKind.LISTEN_ONLY:
            parameters |= bits.INPUT_POINT_TO_POINT
        points = (LogicalSegment(Logical.CONNECTION_POINT, number) for number in (offer.consumed, offer.produced))
        fields: list[EdsField] = [
            f"0x{bits.CLASS_1 | 1 << bits.FIRST_TRIGGER | bits.KINDS[offer.kind]:08X}",
            f"0x{parameters:08X}",
            f"Param{RPI_PARAMETER}",
            str(offer.consumed_octets),
            f"Assem{offer.consumed}" if offer.consumed_octets else "",
            f"Param{RPI_PARAMETER}",
            str(offer.produced_octets),
            f"Assem{offer.produced}",
            "",
            "",
            str(product.configuration_size),
            f"Assem{product.configuration_assembly}" if product.configuration_size else "",
            EdsString(offer.kind.value.title()),
            EdsString(""),
            _path(*logical_path(ASSEMBLY, product.configuration_assembly), *points),
        ]
        yield EdsEntry(f"Connection{place}", tuple(fields))


def _capacity(product: Product) -> Iterator[EdsEntry]:
    """Connections, and the datagrams a second when all of them run at the shortest interval in both directions."""
    datagrams = Fraction(2 * product.io_connections * _NS_PER_SECOND, product.min_rpi_ns)
    largest = max(offer.consumed_size for offer in _settings(product))
    largest = max(largest, *(offer.produced_size for offer in _settings(product)))
    yield EdsEntry("TSpec1", ("TxRx", str(largest), str(int(datagrams))))
    yield EdsEntry("MaxCIPConnections", (str(product.io_connections + product.explicit_connections),))
    yield EdsEntry("MaxIOConnections", (str(product.io_connections),))
    yield EdsEntry("MaxMsgConnections", (str(product.explicit_connections),))


def _standard_objects(product: Product) -> Iterator[EdsSection]:
    identity = IdentityData(
        product.vendor_id, product.device_type, product.product_code, product.revision, 0, product.product_name
    )
    link = EthernetLinkData(bytes(6))
    sections: tuple[tuple[str, AttributeObject, list[EdsEntry]], ...] = (
        ("Identity Class", identity_object(identity), []),
        ("QoS Class", qos_object(QosData()), []),
        ("TCP/IP Interface Class", tcp_ip_object(TcpIpData(IPv4Interface("0.0.0.0/0")), lambda _: None), []),
        (
            "Ethernet Link Class",
            ethernet_link_object(link),
            [
                EdsEntry("InterfaceSpeed1", (str(link.speed_mbps),)),
                EdsEntry("InterfaceLabel1", (EdsString(link.label),)),
            ],
        ),
    )
    for name, found, further in sections:
        yield _section(name, [*_object(name.removesuffix(" Class"), found), *further])


def _object(name: str, found: AttributeObject) -> Iterator[EdsEntry]:
    """What the sections of all objects have; there is one instance of each."""
    revision = int.from_bytes(found.get(0, 1).data, "little")
    yield EdsEntry("Revision", (str(revision),))
    yield EdsEntry("Object_Name", (EdsString(f"{name} Object"),))
    yield EdsEntry("Object_Class_Code", (f"0x{found.class_id:02X}",))
    yield EdsEntry("MaxInst", ("1",))
    yield EdsEntry("Number_Of_Static_Instances", ("1",))
    yield EdsEntry("Max_Number_Of_Dynamic_Instances", ("0",))
    yield EdsEntry("Class_Attributes", tuple(str(number) for number in found.attributes[0]))
    yield EdsEntry("Instance_Attributes", tuple(str(number) for number in found.attributes[1]))
