"""A device by its maker's file as a PROFINET device: plain data in submodules, parameter records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.described.description import with_serial_number
from pnfarm.buses.profinet.described.records import DescribedRecords
from pnfarm.buses.profinet.frame_layout import frame_layout
from pnfarm.errors import InternalError
from pnfarm.signals.station_signals import StationSignals
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.frame_layout import FrameLayout
    from pnfarm.engine.columns import Columns
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
    from pnfarm.protocols.profinet.dcp.device import DcpDevice
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription
    from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue
    from pnfarm.station.station import Station

__all__ = ["DescribedKind"]


class DescribedKind:
    """See :class:`pnfarm.buses.profinet.device.kind.Kind`.

    ``plain_row`` is the station's row of plain data.  Inputs survive a power cycle (assumed: what a sensor sees does
    not depend on the device's supply), and are those that the user or the plant set last.
    """

    telegrams: Mapping[int, tuple[int, Mapping[int, int]]] = {}

    def __init__(self, station: Station, settings: ProfinetDeviceConfig, columns: Columns, plain_row: int) -> None:
        self._station = station
        self._strict = settings.strict
        self.described = settings.described
        self.plain_row = plain_row
        inputs, outputs = self.described.inputs, self.described.outputs
        self.inputs = ProvidedData(columns.provided, plain_row, inputs.octets, len(inputs.places))
        self.outputs = ConsumedData(columns.consumed, plain_row, outputs.octets, len(outputs.places))
        self.signals = StationSignals(self.described.signals, self.described.signal_places, self.inputs, self.outputs)
        self.records: DescribedRecords

    def commission(self, kept: Mapping[str, Any], *, has_address: bool) -> None:
        """No parameter of the device has a part in its address."""

    def take_name(self, kept: dict[str, Any]) -> str | None:
        """No parameter of the device sets a name."""
        del kept
        return None

    def describe(self, mac: bytes) -> DeviceDescription:
        described = self.described
        self.records = DescribedRecords(
            described.record, self._station.note, strict=self._strict, own=described.parameters
        )
        return with_serial_number(described.devices[self._strict], mac)

    @property
    def diagnoses(self) -> DiagnosisCatalogue:
        return self.described.diagnoses

    def join(self, dcp: DcpDevice, mac: bytes, cm: CmDevice) -> None:
        """Nothing here acts on the machines."""

    def next_deadline(self) -> int | None:
        """It has no parameter channel."""
        return None

    def handle_timeout(self, now: int) -> None:
        """See :meth:`next_deadline`."""

    # -- cyclic data -------------------------------------------------------------------------------------------------

    def follow_modules(self) -> None:
        """Data of what is plugged have their place always."""

    def layout(self, channel: IocrLayout, ar: ArChannels, unusable: frozenset[ExpectedKey]) -> FrameLayout:
        del ar
        data = self.described.inputs if channel.is_input else self.described.outputs
        return frame_layout(channel, (), unusable, data.places, receives=not channel.is_input)

    def feeds(self, ar: ArChannels) -> frozenset[int]:
        """Each connection has outputs of its own submodules."""
        del ar
        return frozenset({0})

    def opened(self, fastest_ns: int) -> None:
        """No firmware step depends on the cycle."""

    def fed(self, ar: ArChannels) -> None:
        """No axis depends on the connection."""

    def closed(self, ar: ArChannels, *, any_left: bool) -> None:
        """Outputs keep their last value, with status BAD: the engine sees to that."""

    def lost(self, ar: ArChannels) -> None:
        """A device has no fault of its own for it."""

    def telegram(self) -> int:
        return 0

    def telegram_of(self, module: ModuleDescription) -> int | None:
        del module
        return None

    def key_of(self, slot: int, subslot: int | None = None) -> tuple[str | int, ...]:
        if not slot:
            return ("access_point",)
        return ("slots", str(slot), *(() if subslot is None else ("submodules", str(subslot))))

    def module_name(self, ident: int) -> str:
        gsdml = self.described.plugged.gsdml
        idents = [*((one.ident, one.id) for one in gsdml.modules), *((one.ident, one.id) for one in gsdml.daps)]
        return next((name for known, name in idents if known == ident), "")

    def record_complaint(self, slot: int, subslot: int, index: int) -> str:
        return self.records.complaints.get((slot, subslot, index), "")

    # -- events ------------------------------------------------------------------------------------------------------

    def fault_raised(self, axis: int, number: int) -> None:
        """There is no axis."""
        raise InternalError(f"axis {axis + 1} of a device without axes raised fault {number}")

    def faults_cleared(self, axis: int) -> None:
        """There is no axis."""
        raise InternalError(f"axis {axis + 1} of a device without axes cleared its faults")

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        """There is no axis."""
        raise InternalError(f"axis {axis + 1} of a device without axes has task {value:#x} at {now}")

    def address_set(self) -> None:
        """No parameter shows it."""

    def address_forgotten(self) -> None:
        """No parameter shows it."""

    def reset_application(self) -> None:
        self.records.forget()
