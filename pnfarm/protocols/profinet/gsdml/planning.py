"""From a GSDML file and a choice of modules to what a controller expects of that device."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.plan import ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.gsdml.station import plug_station
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.wire.rtc import SEND_CLOCK_FACTORS, SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Mapping

    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord as Described
    from pnfarm.protocols.profinet.gsdml.station import Place, PluggedStation, PluggedSubmodule, Wanted

    #: API, slot, subslot, index.
    RecordPlace = tuple[int, int, int, int]
    #: (slot, subslot, index) -> a record as a whole, or values by the names that the file gives them.
    Parameters = Mapping[tuple[int, int, int], bytes | Mapping[str, str | float]]

__all__ = ["PlannedDevice", "from_gsdml", "plan_station"]


def _doublings(send_clock: int) -> int:
    """Between a send clock and 1 ms."""
    return abs(send_clock.bit_length() - (32).bit_length())


@dataclass(frozen=True, slots=True)
class PlannedDevice:
    """What goes into an ``ArPlan`` for this device, and what its file says of timing and start-up.

    ``records`` are in the order in which they have to be written.
    """

    vendor_id: int
    device_id: int
    dap: Dap
    submodules: tuple[PlannedSubmodule, ...]
    records: tuple[ParameterRecord, ...]

    @property
    def instance(self) -> int:
        return self.dap.instance

    @property
    def multiple_write(self) -> bool:
        return self.dap.multiple_write

    @property
    def min_cycle_ns(self) -> int:
        """The fastest cycle, nanoseconds."""
        return self.dap.min_device_interval * SEND_CLOCK_NS

    def slowed(self, cycle_ns: int) -> int:
        """A cycle, doubled until the device is as fast."""
        while cycle_ns < self.min_cycle_ns:
            cycle_ns *= 2
        return cycle_ns

    def clock(self, send_clock_factor: int, reduction_ratio: int) -> tuple[int, int]:
        """The pair itself if the device supports it, else the pair for the same cycle with the send clock next to 1 ms.

        A pair that no other can replace is returned unchanged; :meth:`check_clock` says what is wrong with it.
        """
        units = send_clock_factor * reduction_ratio
        others = [(clock, units // clock) for clock in SEND_CLOCK_FACTORS if units % clock == 0]
        others.sort(key=lambda pair: _doublings(pair[0]))
        for pair in ((send_clock_factor, reduction_ratio), *others):
            with suppress(ConfigError):
                self.check_clock(*pair)
                return pair
        return send_clock_factor, reduction_ratio

    def check_clock(self, send_clock_factor: int, reduction_ratio: int) -> None:
        """Raise :class:`ConfigError` when the device does not take this cycle."""
        clocks, ratios = self.dap.relations.send_clocks, self.dap.relations.ratios
        if send_clock_factor not in clocks:
            raise ConfigError(
                f"the device does not support send clock factor {send_clock_factor}; its file names {clocks.emit()}"
            )
        if reduction_ratio not in ratios:
            raise ConfigError(
                f"the device does not support reduction ratio {reduction_ratio}; its file names {ratios.emit()}"
            )
        cycle_ns = send_clock_factor * reduction_ratio * SEND_CLOCK_NS
        if cycle_ns < self.min_cycle_ns:
            raise ConfigError(
                f"a cycle of {cycle_ns / 1e6:g} ms is too fast for the device; its file names "
                f"{self.min_cycle_ns / 1e6:g} ms"
            )

    def startup(self, wanted: Literal["legacy", "advanced"] | None = None) -> Literal["legacy", "advanced"]:
        """The start-up mode: the requested one, else legacy if the device supports it.  Raises :class:`ConfigError`."""
        modes = tuple(mode.lower() for mode in self.dap.relations.startup_modes)
        if wanted is None:
            return "advanced" if "legacy" not in modes and "advanced" in modes else "legacy"
        if wanted not in modes:
            raise ConfigError(
                f"the device does not support start-up {wanted}; its file names {', '.join(modes) or 'no mode'}"
            )
        return wanted


class _Parameters:
    """Records with what the user changes of them."""

    def __init__(self, parameters: Parameters, replaced: Container[RecordPlace]) -> None:
        self._left = dict(parameters)
        self._replaced = replaced

    def of(self, submodule: PluggedSubmodule, record: Described) -> ParameterRecord:
        """One record as it is written."""
        slot, subslot = submodule.slot, submodule.subslot
        given = self._left.pop((slot, subslot, record.index), None)
        if isinstance(given, bytes):
            if len(given) != record.length:
                raise ConfigError(
                    f"record {record.index} of slot {slot}, subslot 0x{subslot:04X} is given {len(given)} octets, "
                    f"it has {record.length}"
                )
            data = given
        elif given is None and (submodule.api, slot, subslot, record.index) in self._replaced:
            data = record.defaults()
        else:
            data = record.octets(given)
        return ParameterRecord(submodule.api, slot, subslot, record.index, data)

    def check(self) -> None:
        """Raise :class:`ConfigError` for a change of a record that the file does not have."""
        if self._left:
            slot, subslot, index = next(iter(self._left))
            raise ConfigError(f"slot {slot}, subslot 0x{subslot:04X} has no record {index} in the file")


def _planned(station: PluggedStation, *, safe: bool) -> Iterator[PlannedSubmodule]:
    # what captured controllers do where the file has IOXS_Required="false": submodules without data alone
    without_data = 0 if station.dap.ioxs_required else SubmoduleProperties.DISCARD_IOXS
    for one in station.submodules:
        line = f"line {one.line}: " if one.line else ""
        if one.profisafe and not safe:
            raise ConfigError(f"{line}{one.id} is fail-safe, this controller does not support PROFIsafe")
        if (one.iops_length, one.iocs_length) != (1, 1):
            raise ConfigError(f"{line}{one.id} has status fields longer than one octet, this controller sends one")
        yield PlannedSubmodule(
            one.api,
            one.slot,
            one.module_ident,
            one.subslot,
            one.ident,
            one.input_octets,
            one.output_octets,
            0 if one.has_data else without_data,
        )


def from_gsdml(
    gsdml: Gsdml,
    *,
    dap: Wanted | None = None,
    modules: Mapping[int, Wanted | None] | None = None,
    submodules: Mapping[Place, Wanted | None] | None = None,
    parameters: Parameters | None = None,
    replaced: Container[RecordPlace] = (),
) -> PlannedDevice:
    """Plan a device.

    ``dap``, ``modules`` and ``submodules`` are as :func:`~pnfarm.protocols.profinet.gsdml.station.plug_station` takes
    them.  ``parameters`` (slot, subslot, index) changes records from their defaults; those that are ``replaced`` (API,
    slot, subslot, index) need no default that can be put together.  Raises :class:`ConfigError` for whatever the file
    does not allow.
    """
    station = plug_station(gsdml, access_point=dap, modules=modules, submodules=submodules)
    return plan_station(station, parameters, replaced=replaced)


def plan_station(
    station: PluggedStation,
    parameters: Parameters | None = None,
    *,
    safe: bool = False,
    replaced: Container[RecordPlace] = (),
) -> PlannedDevice:
    """The same of a device that is plugged already.

    ``safe``: fail-safe submodules are planned as all others, and exchange data without the safety protocol.
    """
    changed = _Parameters(parameters or {}, replaced)
    submodules_planned = tuple(_planned(station, safe=safe))
    written = [
        (record.transfer_sequence, changed.of(submodule, record))
        for submodule in station.submodules
        for record in submodule.records
    ]
    changed.check()
    return PlannedDevice(
        vendor_id=station.vendor_id,
        device_id=station.device_id,
        dap=station.dap,
        submodules=submodules_planned,
        # those without a transfer sequence first and in the file's order
        records=tuple(record for _, record in sorted(written, key=lambda pair: pair[0])),
    )
