"""A drive as a slave: its model, parameters, telegrams and lamps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.buses.profibus.device.kept_values import DRIVE, check_kept
from pnfarm.buses.profibus.device.lamps import lamps
from pnfarm.buses.profibus.device.product import Product
from pnfarm.buses.profibus.device.station_address import DEFAULT_ADDRESS, SWITCHES, station_address
from pnfarm.buses.profibus.device.user import DriveUser
from pnfarm.drives.parameters.network import NoNetwork
from pnfarm.errors import ConfigError
from pnfarm.firmware.motion.interpolation import POSITION_MODE
from pnfarm.protocols.profibus.slave_user import SlaveOptions
from pnfarm.station.parameter_words import StationParameterWords
from pnfarm.station.step_time import FASTEST_STEP_NS, SLOWEST_STEP_NS, longest_step_ns
from pnfarm.table.axis_codes import CMD_RAISE_FAULT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profibus.config.drive import ProfibusDriveConfig
    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.buses.profibus.device.lamps import LampState
    from pnfarm.buses.profibus.device.station_address import StationAddress
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.protocols.profibus.wire.dp import Parameters
    from pnfarm.station.station import Station

__all__ = ["DriveKind"]


class DriveKind:
    """See :class:`pnfarm.buses.profibus.device.kind.Kind`."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._handle = station.axis.handle
        self._model = station.axis.model
        self.product = Product.of(self._model)
        self.fixed_length = self.product.fixed_length
        self.parameters_key: tuple[str, ...] = ("limits",)
        self.user: DriveUser
        self._parameter_words: StationParameterWords

    @property
    def _config(self) -> ProfibusDriveConfig:
        """This drive's settings in the farm file."""
        return cast("ProfibusDriveConfig", self._station.config)

    @property
    def _store(self) -> ParameterStore:
        """The drive's parameters; recreated at each power-on."""
        return self._station.axis.store

    @property
    def number(self) -> int:
        return self._store.telegram_number

    @property
    def reports_faults(self) -> bool:
        return self.user.reports_faults

    # -- life --------------------------------------------------------------------------------------------------------

    def check(self, kept: Mapping[str, Any]) -> None:
        check_kept(kept, DRIVE)

    def commission(self, kept: Mapping[str, Any]) -> None:
        """An address entered with the buttons is in the parameter."""
        if self._config.control_unit is not None and "drive" not in kept:
            self._store.commission({self.product.address_parameter: self._config.control_unit})

    def address(self, kept: Mapping[str, Any]) -> StationAddress:
        """By the coding switches, else by the parameter (Moog MSD manual 4.2.2); both count at power-on."""
        del kept
        parameter = self.product.address_parameter
        found = station_address(self._config.switches, self._store.raw(parameter, DEFAULT_ADDRESS))
        if found.origin == SWITCHES and self.product.address_in_force:
            self._store.overruled[parameter] = found.address
        return found

    def build(self, image: CyclicImage) -> SlaveOptions:
        product, latency = self.product, self._station.latency
        self.user = DriveUser(self._store, image, product, strict=self._config.strict, latency=latency)
        self._parameter_words = StationParameterWords(self._store, latency)
        return SlaveOptions(
            self._model.profidrive.identity.device_id,
            supports_freeze=product.freeze,
            supports_sync=product.sync,
            supports_fail_safe=product.fail_safe,
            address_changes=product.address_changes and self._config.switches > HIGHEST_ADDRESS,
            connections=product.connections,
            longest_record=product.longest_record,
            send_timeout_ns=product.send_timeout_ns,
            class_two_exchanged=product.class_two_exchanged,
            silence_ns=product.silence_ns,
        )

    def next_deadline(self) -> int | None:
        times = (self.user.channel.next_deadline(), self._parameter_words.next_deadline())
        return min((time for time in times if time is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        self.user.channel.handle_timeout(now)
        self._parameter_words.handle_timeout(now)

    # -- the slave's life --------------------------------------------------------------------------------------------

    def follow(self) -> None:
        self.user.plug()

    def layout(self) -> None:
        self.user.layout()

    def rate_known(self, baud: int) -> None:
        rate = self.product.baud_code(baud) if baud else 0
        self._store.network = NoNetwork(name=self._station.configured_name, line_rate=rate)

    def parametrised(self, parameters: Parameters) -> str | None:
        self._store.watchdog_ns = parameters.watchdog_ns()
        return None

    def began(self) -> None:
        self._handle.axis.step_ns = FASTEST_STEP_NS
        self._handle.image.good = 1

    def cycle_known(self, mean_ns: int) -> None:
        """The bus has no agreed cycle: the master's own is measured.

        A drive that makes a curve of positions reads the cycle from its own steps, and keeps the shortest.
        """
        axis = self._handle.axis
        curve = axis.drive.settings.opmode == POSITION_MODE
        axis.step_ns = FASTEST_STEP_NS if curve else longest_step_ns(mean_ns)

    def expired(self) -> None:
        code = int(self._handle.axis.faults.settings.loss_fault)
        if code:
            self._handle.push_command(CMD_RAISE_FAULT, code)

    def ended(self) -> None:
        self._store.channels_closed()
        self._store.watchdog_ns = 0
        self._parameter_words.reset()
        self._handle.axis.step_ns = SLOWEST_STEP_NS

    def difference(self, identifiers: bytes) -> tuple[int, str] | None:
        """Its master chooses the telegram."""
        del identifiers
        return None

    def readdressed(self, address: int, now: int) -> None:
        """The parameter has the address from now on."""
        self._store.set(self.product.address_parameter, address)
        self._store.commission({self.product.address_parameter: address})
        self._station.keep(now, "drive", self._store.snapshot())

    # -- the axis and observers --------------------------------------------------------------------------------------

    def parameter_task(self, value: int, now: int) -> None:
        self._parameter_words.take(value, now)

    def diagnosis(self, name: str, slot: int, channel: int) -> bytes:
        """No file names a drive's."""
        del slot, channel
        raise ConfigError(f"{self._station.configured_name} is a drive, and has no diagnosis {name!r}: give a number")

    def lamps(self, state: LampState) -> Mapping[str, str]:
        return lamps(self.product, state)

    def details(self) -> Mapping[str, Any]:
        """Nothing more."""
        return {}
