"""A device by its maker's file as a slave of PROFIBUS."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.described.user import DescribedUser
from pnfarm.buses.profibus.device.kept_values import DEVICE, check_kept
from pnfarm.buses.profibus.device.station_address import DEFAULT_ADDRESS, StationAddress
from pnfarm.errors import InternalError
from pnfarm.protocols.profibus.gsd.diagnosis import diagnosis_blocks
from pnfarm.protocols.profibus.slave_user import SlaveOptions
from pnfarm.signals.station_signals import StationSignals
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profibus.config.device import ProfibusDeviceConfig
    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.buses.profibus.device.lamps import LampState
    from pnfarm.engine.columns import Columns
    from pnfarm.protocols.profibus.wire.dp import Parameters
    from pnfarm.station.station import Station

__all__ = ["DescribedKind"]

#: Where an address comes from.
FARM_FILE, MASTER, NOWHERE = "farm file", "master", "nowhere"


class DescribedKind:
    """See :class:`pnfarm.buses.profibus.device.kind.Kind`.

    Inputs survive a power cycle (assumed: what a sensor sees does not depend on the device's supply).  Outputs are
    zero, with status BAD, while no master in Operate sends them.
    """

    number = 0
    reports_faults = False
    fixed_length = False
    # as many as its modules have
    parameters_key: tuple[str, ...] = ("slots",)

    def __init__(self, station: Station, settings: ProfibusDeviceConfig, columns: Columns, plain_row: int) -> None:
        self._station = station
        self._settings = settings
        described = self.described = settings.described
        plugged = described.plugged
        self.inputs = ProvidedData(columns.provided, plain_row, plugged.inputs, described.statuses("input"))
        self.outputs = ConsumedData(columns.consumed, plain_row, plugged.outputs, described.statuses("output"))
        self.signals = StationSignals(described.signals, described.signal_places, self.inputs, self.outputs)
        self.user: DescribedUser

    def check(self, kept: Mapping[str, Any]) -> None:
        check_kept(kept, DEVICE)

    def commission(self, kept: Mapping[str, Any]) -> None:
        """It has no parameters beside those of Set_Prm."""

    def address(self, kept: Mapping[str, Any]) -> StationAddress:
        """What a master set and the device kept, else that of the farm file."""
        if self.described.plugged.gsd.address_changes and "address" in kept:
            return StationAddress(kept["address"], MASTER)
        given = self._settings.address
        return StationAddress(DEFAULT_ADDRESS, NOWHERE) if given is None else StationAddress(given, FARM_FILE)

    def build(self, image: CyclicImage) -> SlaveOptions:
        gsd, strict = self.described.plugged.gsd, self._settings.strict
        self.user = DescribedUser(self.described, image, self.inputs, self.outputs, strict=strict)
        return SlaveOptions(
            gsd.ident,
            supports_freeze=gsd.freeze,
            supports_sync=gsd.sync,
            supports_fail_safe=gsd.fail_safe,
            address_changes=gsd.address_changes,
            v1=gsd.v1,
            class_one=bool(gsd.class_one),
            connections=gsd.connections,
            longest_record=max(gsd.class_one, gsd.class_two),
        )

    def next_deadline(self) -> int | None:
        """Every request is carried out at once."""
        return None

    def handle_timeout(self, now: int) -> None:
        """See :meth:`next_deadline`."""

    # -- the slave's life --------------------------------------------------------------------------------------------

    def follow(self) -> None:
        """Its modules are those of the farm file."""

    def layout(self) -> None:
        """See :meth:`follow`."""

    def rate_known(self, baud: int) -> None:
        """No parameter shows it."""

    def parametrised(self, parameters: Parameters) -> str | None:
        """The octets are kept; lax limits let wrong ones pass."""
        self.user.parameters = parameters.user
        return self.described.plugged.complaint(parameters.user)

    def began(self) -> None:
        """No firmware step depends on the connection."""

    def cycle_known(self, mean_ns: int) -> None:
        """See :meth:`began`."""

    def expired(self) -> None:
        """A device has no fault of its own for it."""

    def ended(self) -> None:
        self.user.without_master()

    def difference(self, identifiers: bytes) -> tuple[int, str] | None:
        return self.described.plugged.difference(identifiers)

    def readdressed(self, address: int, now: int) -> None:
        self._station.keep(now, "address", address)

    # -- the axis and observers --------------------------------------------------------------------------------------

    def parameter_task(self, value: int, now: int) -> None:
        """There is no axis."""
        raise InternalError(f"a device without axes has task {value:#x} at {now}")

    def diagnosis(self, name: str, slot: int, channel: int) -> bytes:
        return diagnosis_blocks(self.described.plugged, name, slot, channel)

    def lamps(self, state: LampState) -> Mapping[str, str]:
        """Its file describes none."""
        del state
        return {}

    def details(self) -> Mapping[str, Any]:
        """The octets of Set_Prm that were taken last, empty before."""
        return {"parameters": self.user.parameters.hex(" ")}
