"""The model of a station by its VendorID and DeviceID."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.decoding.identity import models_by

if TYPE_CHECKING:
    from pnfarm.captures.stations import Stations
    from pnfarm.drives.description.model import Model

__all__ = ["learn_identity", "numbers_of"]


def numbers_of(model: Model) -> tuple[int, int]:
    return model.profidrive.identity.vendor_id, model.profidrive.identity.device_id


def learn_identity(stations: Stations, mac: bytes, vendor_id: int, device_id: int) -> None:
    """VendorID and DeviceID, as DCP and Connect carry them."""
    if (found := models_by("profinet", numbers_of).get((vendor_id, device_id))) is not None:
        stations.suppose(mac, found)
