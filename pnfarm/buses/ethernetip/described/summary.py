"""What a described device is, for views."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.described.file_signals import SUBSLOT
from pnfarm.station.description import ModuleDescription, StationDescription, SubmoduleDescription

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.described.station import DescribedStation, Point

__all__ = ["station_description"]


def station_description(described: DescribedStation) -> StationDescription:
    """Identity, the built-in controller's connection, assemblies with cyclic data."""
    sheet = described.sheet
    names = {one.instance: one.name for one in sheet.assemblies.values()}
    return StationDescription(
        title=described.title,
        identity={
            "vendor": sheet.vendor,
            "vendor_id": sheet.key.vendor_id,
            "device_type": sheet.key.device_type,
            "product_code": sheet.key.product_code,
            "order_number": sheet.catalog,
            "revision": f"{sheet.key.major_revision}.{sheet.key.minor_revision}",
        },
        access_point=described.connection.name or described.connection.keyword,
        modules=tuple(_module(point, names.get(point.instance, "")) for point in described.points),
    )


def _module(point: Point, name: str) -> ModuleDescription:
    octets = (point.octets, 0) if point.direction == "input" else (0, point.octets)
    title = name or f"Assembly {point.instance}"
    return ModuleDescription(
        point.instance, point.instance, title, (SubmoduleDescription(SUBSLOT, point.instance, title, *octets),)
    )
