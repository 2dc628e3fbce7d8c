"""The model of a station by its VendorID and DeviceID."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from pnfarm.drives.catalogue import model, models

if TYPE_CHECKING:
    from pnfarm.captures.stations import Stations
    from pnfarm.drives.description.model import Model

__all__ = ["learn_identity"]


@cache
def _model_of(vendor_id: int, device_id: int) -> Model | None:
    """The first PROFINET model of this vendor and device number."""
    for entry in models().values():
        if entry.bus == "profinet":
            identity = model(entry.name).profidrive.identity
            if (identity.vendor_id, identity.device_id) == (vendor_id, device_id):
                return model(entry.name)
    return None


def learn_identity(stations: Stations, mac: bytes, vendor_id: int, device_id: int) -> None:
    """VendorID and DeviceID, as DCP and Connect carry them."""
    if (found := _model_of(vendor_id, device_id)) is not None:
        stations.suppose(mac, found)
