"""A drive on EtherNet/IP: its parameters as objects, its axis's assemblies, its own fault when it is left alone."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from pnfarm.buses.ethernetip.device.kind import Carried
from pnfarm.buses.ethernetip.device.objects.front_tasks import FrontTasks
from pnfarm.buses.ethernetip.device.objects.parameter_object import ParameterObject
from pnfarm.buses.ethernetip.device.objects.position_controller import PositionController, Supervisor
from pnfarm.buses.ethernetip.device.objects.values import CipValues
from pnfarm.buses.ethernetip.device.offers import assemblies_of, connection_settings
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.objects.identity import IdentityData
from pnfarm.station.step_time import SLOWEST_STEP_NS, longest_step_ns
from pnfarm.table.axis_codes import CMD_RAISE_FAULT
from pnfarm.table.signals import ASSEMBLY, PART_HIGH, PART_LOW, word_code

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from ipaddress import IPv4Address

    from pnfarm.config.drive import DriveConfig
    from pnfarm.protocols.enip.connection import Connection, ConnectionSettings, IoOffer
    from pnfarm.protocols.enip.connection_check import Refusal
    from pnfarm.protocols.enip.object import CipObject
    from pnfarm.protocols.enip.objects.assembly import AssemblyData
    from pnfarm.protocols.enip.wire.epath import ElectronicKey
    from pnfarm.station.station import Station

__all__ = ["DriveKind"]

#: A 32-bit word of an assembly, and its halves.
_WORD, _HALF = 4, 2


def _words(octets: int) -> list[tuple[int, int]]:
    """An assembly's words: (code, offset), the less significant half first."""
    words = []
    for number in range(octets // _WORD):
        words.append((word_code(ASSEMBLY + number, PART_LOW), _WORD * number))
        words.append((word_code(ASSEMBLY + number, PART_HIGH), _WORD * number + _HALF))
    return words


class DriveKind:
    """See :class:`pnfarm.buses.ethernetip.device.kind.Kind`."""

    plain_row = 0
    label = "X11"
    keys: Mapping[str, tuple[str, ...]] = MappingProxyType(
        {"key": ("identity",), "path": ("model",), "sizes": ("model",), "interval": ("limits",)}
    )

    def __init__(self, station: Station) -> None:
        self._station = station
        self._axis = station.axis
        self.product = Product.of(self._axis.model)
        self.io_connections, self.sessions = self.product.io_connections, self.product.sessions
        self.assemblies: Sequence[AssemblyData] = assemblies_of(self.product, self._axis.handle.image)
        self.objects: Sequence[CipObject] = ()
        self._tasks: FrontTasks

    def build(self) -> None:
        store = self._axis.store
        values = CipValues(store)
        controller = PositionController(store, values)
        parameters = ParameterObject(store, values, controller.enable)
        self._tasks = FrontTasks(store, values, parameters, controller, self._station.latency)
        self.objects = (parameters, controller, Supervisor(store))

    def identity(self, serial: int) -> IdentityData:
        product = self.product
        return IdentityData(
            product.vendor_id,
            product.device_type,
            product.product_code,
            product.revision,
            serial,
            product.product_name,
        )

    def settings(self, key: ElectronicKey, multicast: IPv4Address) -> ConnectionSettings:
        strict = cast("DriveConfig", self._station.config).strict
        return connection_settings(self.product, key, multicast, strict=strict)

    def configure(self, offer: IoOffer, data: bytes) -> Refusal | None:
        """Its configuration assembly has no octets."""
        del offer, data
        return None

    # -- cyclic data -------------------------------------------------------------------------------------------------

    def consumed(self, connection: Connection) -> Carried:
        """Commands, which only an owner has."""
        feeds = connection.kind is ConnectionKind.EXCLUSIVE_OWNER
        return Carried(_words(connection.consumed_octets) if feeds else ())

    def produced(self, connection: Connection) -> Carried:
        return Carried(_words(connection.produced_octets))

    def fed(self, timeout_ns: int, cycle_ns: int) -> None:
        self._axis.store.watchdog_ns = timeout_ns
        self._axis.handle.axis.interpolation.settings.cycle_ns = cycle_ns

    def unfed(self) -> None:
        self._axis.store.channels_closed()

    def lost(self) -> None:
        """The drive raises its own fault (AKD EtherNet/IP manual 5.3: F702)."""
        code = int(self._axis.handle.axis.faults.settings.loss_fault)
        if code:
            self._axis.handle.push_command(CMD_RAISE_FAULT, code)

    def paced(self, fastest_ns: int | None) -> None:
        self._axis.handle.axis.step_ns = SLOWEST_STEP_NS if fastest_ns is None else longest_step_ns(fastest_ns)

    @property
    def faulty(self) -> bool:
        return int(self._axis.handle.axis.faults.code[0]) != 0

    # -- tasks -------------------------------------------------------------------------------------------------------

    def parameter_task(self, value: int, now: int) -> None:
        """A task of the front."""
        self._tasks.take(value, now)

    def next_deadline(self) -> int | None:
        return self._tasks.next_deadline()

    def handle_timeout(self, now: int) -> None:
        self._tasks.handle_timeout(now)
