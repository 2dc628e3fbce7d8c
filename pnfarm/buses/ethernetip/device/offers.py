"""What a drive on EtherNet/IP offers: assemblies, and the connections to them (AKD EtherNet/IP manual 5.2, 6.2.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.protocols.enip.connection import ConnectionKind, ConnectionSettings, IoOffer, RpiBelowMinimum
from pnfarm.protocols.enip.objects.assembly import AssemblyData
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.buses.ethernetip.device.product import Product
    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = ["assemblies_of", "connection_settings"]

_US = 1000


def assemblies_of(product: Product, image: Any) -> list[AssemblyData]:
    """Configuration, command and response; read only here, as the commands belong to the connection's owner."""

    def words(row: Any, octets: int) -> bytes:
        return bytes(row[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS].astype("<i4").tobytes()[:octets])

    return [
        AssemblyData(product.configuration_assembly, product.configuration_size, lambda: b""),
        AssemblyData(product.output_assembly, product.output_size, lambda: words(image.received, product.output_size)),
        AssemblyData(product.input_assembly, product.input_size, lambda: words(image.sent, product.input_size)),
    ]


def connection_settings(
    product: Product, key: ElectronicKey, multicast: IPv4Address, *, strict: bool
) -> ConnectionSettings:
    """``strict``: intervals below the product's are lengthened to it, others to its next step."""

    def offer(kind: ConnectionKind, consumed: int, octets: int) -> IoOffer:
        return IoOffer(
            kind,
            consumed,
            product.input_assembly,
            octets,
            product.input_size,
            product.configuration_assembly,
            product.configuration_size,
            product.output_run_idle,
            product.input_run_idle,
        )

    return ConnectionSettings(
        key,
        (
            offer(ConnectionKind.EXCLUSIVE_OWNER, product.output_assembly, product.output_size),
            offer(ConnectionKind.INPUT_ONLY, product.input_only_assembly, 0),
            offer(ConnectionKind.LISTEN_ONLY, product.listen_only_assembly, 0),
        ),
        multicast,
        io_connections=product.io_connections,
        explicit_connections=product.explicit_connections,
        minimum_rpi_us=product.min_rpi_ns // _US,
        interval_step_us=product.interval_step_ns // _US if strict else 1,
        below_minimum=RpiBelowMinimum.ROUND_UP if strict else RpiBelowMinimum.ACCEPT,
        null_open_status=product.null_open_status,
    )
