"""From a GSDML file and a choice of modules to what a controller expects of that device.

Modules and submodules that the file fixes are always planned; those that it puts into a new project are planned
unless their place is given another one, or None for none.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.controller.plan import ParameterRecord, PlannedSubmodule
from pnfarm.protocols.profinet.gsdml.document import PortSubmodule, SubmoduleItem
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml, InterfaceSubmodule, ItemRef, ModuleItem
    from pnfarm.protocols.profinet.gsdml.values import Numbers

    #: (slot, subslot, index) -> a record as a whole, or values by the names that the file gives them.
    Parameters = Mapping[tuple[int, int, int], bytes | Mapping[str, str | float]]

__all__ = ["Place", "PlannedDevice", "from_gsdml"]

#: SendClockFactors of the RT classes.
_SEND_CLOCKS = tuple(1 << exponent for exponent in range(8))

#: Modules of a device and submodules of a module; real ones have some hundred.
_MOST = 4096
#: Octets of a device's records; real ones have some thousand.
_MOST_OCTETS = 1 << 22

#: Slot and subslot.
Place = tuple[int, int]

_Any = SubmoduleItem | PortSubmodule


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

    def clock(self, send_clock_factor: int, reduction_ratio: int) -> tuple[int, int]:
        """The pair itself if the device supports it, else the pair for the same cycle with the send clock next to 1 ms.

        A pair that no other can replace is returned unchanged; :meth:`check_clock` says what is wrong with it.
        """
        units = send_clock_factor * reduction_ratio
        others = [(clock, units // clock) for clock in _SEND_CLOCKS if units % clock == 0]
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


def _choose_dap(gsdml: Gsdml, wanted: str | None) -> Dap:
    ids = ", ".join(dap.id for dap in gsdml.daps)
    if wanted is None:
        if len(gsdml.daps) != 1:
            raise ConfigError(f"the file describes several access points, choose one of {ids}")
        return gsdml.daps[0]
    found = next((dap for dap in gsdml.daps if dap.id == wanted), None)
    if found is None:
        raise ConfigError(f"the file has no access point {wanted!r}, it has {ids}")
    return found


def _contents(
    refs: Sequence[ItemRef], chosen: Mapping[int, str | None], physical: Numbers, what: str, place: str
) -> dict[int, str]:
    """Place -> target: what is fixed, what a new project has, and what was chosen."""
    filled: dict[int, str] = {}
    fixed: dict[int, str] = {}
    placed = 0
    for ref in refs:
        placed += len(ref.used) + len(ref.fixed)
        if placed > _MOST:
            raise ConfigError(
                f"{_line(ref.line)}{ref.target} and those before it are fixed in {placed} {place}s, "
                f"at most {_MOST} can be planned"
            )
        filled |= dict.fromkeys(ref.used, ref.target)
        fixed |= dict.fromkeys(ref.fixed, ref.target)
    filled |= fixed
    for number, target in chosen.items():
        if target is None:
            if number in fixed:
                raise ConfigError(f"{place} {number} cannot be empty, {fixed[number]} is fixed there")
            filled.pop(number, None)
            continue
        able = [ref.target for ref in refs if ref.takes(number) and (not physical.ranges or number in physical)]
        if target not in able:
            shown = ", ".join(able[:20]) + (" and others" if len(able) > 20 else "")
            raise ConfigError(f"{place} {number} takes no {what} {target!r}, it takes {shown or 'none at all'}")
        if fixed.get(number, target) != target:
            raise ConfigError(f"{place} {number} takes no {what} {target!r}, {fixed[number]} is fixed there")
        filled[number] = target
    return filled


def _line(line: int) -> str:
    """Where the file says something; nothing for a description that was not read."""
    return f"line {line}: " if line else ""


def _system(
    interfaces: Iterable[InterfaceSubmodule], ports: Iterable[PortSubmodule]
) -> Iterator[tuple[int, PortSubmodule]]:
    for interface in interfaces:
        yield (
            interface.subslot,
            PortSubmodule(interface.id, interface.ident, interface.subslot, interface.name, records=interface.records),
        )
    for port in ports:
        yield port.subslot, port


class _Planner:
    def __init__(self, gsdml: Gsdml, parameters: Parameters, *, ioxs_required: bool) -> None:
        pluggable: tuple[_Any, ...] = (*gsdml.submodules, *gsdml.pluggable_ports)
        self._pluggable = {one.id: one for one in pluggable}
        # what captured controllers do where the file has IOXS_Required="false": submodules without data alone
        self._without_data = 0 if ioxs_required else SubmoduleProperties.DISCARD_IOXS
        self._parameters = dict(parameters)
        self.submodules: dict[Place, PlannedSubmodule] = {}
        self._records: list[tuple[int, ParameterRecord]] = []
        self._octets = 0

    def plug(self, slot: int, holder: Dap | ModuleItem, chosen: Mapping[int, str | None]) -> None:
        """Everything of one slot."""
        for virtual in holder.submodules:
            for subslot in virtual.fixed:
                self._add(slot, subslot, holder.ident, virtual)
        interfaces = getattr(holder, "interfaces", ())
        for subslot, port in _system(interfaces, holder.ports):
            self._add(slot, subslot, holder.ident, port)
        filled = _contents(holder.useable, chosen, holder.physical_subslots, "submodule", f"slot {slot}, subslot")
        for subslot, target in filled.items():
            item = self._pluggable.get(target)
            if item is None:
                raise ConfigError(f"the file names submodule {target!r} for slot {slot} and does not describe it")
            self._add(slot, subslot, holder.ident, item)

    def _add(self, slot: int, subslot: int, module_ident: int, item: _Any) -> None:
        if (slot, subslot) in self.submodules:
            raise ConfigError(f"slot {slot}, subslot 0x{subslot:04X} is taken twice, one submodule fits there")
        if len(self.submodules) >= _MOST:
            raise ConfigError(f"slot {slot} has more submodules than fit, at most {_MOST} can be planned")
        api, lengths = 0, (0, 0)
        if isinstance(item, SubmoduleItem):
            if item.profisafe:
                raise ConfigError(
                    f"{_line(item.line)}{item.id} is fail-safe, this controller does not support PROFIsafe"
                )
            if (item.iops_length, item.iocs_length) != (1, 1):
                raise ConfigError(
                    f"{_line(item.line)}{item.id} has status fields longer than one octet, this controller sends one"
                )
            api, lengths = item.api, (item.input_octets, item.output_octets)
        properties = 0 if any(lengths) else self._without_data
        self.submodules[slot, subslot] = PlannedSubmodule(
            api, slot, module_ident, subslot, item.ident, *lengths, properties
        )
        for record in item.records:
            self._octets += record.length
            if self._octets > _MOST_OCTETS:
                raise ConfigError(f"slot {slot} has more records than can be written, at most {_MOST_OCTETS} octets")
            given = self._parameters.pop((slot, subslot, record.index), None)
            if isinstance(given, bytes):
                if len(given) != record.length:
                    raise ConfigError(
                        f"record {record.index} of slot {slot}, subslot 0x{subslot:04X} is given {len(given)} octets, "
                        f"it has {record.length}"
                    )
                data = given
            else:
                data = record.octets(given)
            self._records.append((record.transfer_sequence, ParameterRecord(api, slot, subslot, record.index, data)))

    def records(self) -> tuple[ParameterRecord, ...]:
        """In the order of their transfer sequence, those without one first and in the file's order."""
        if self._parameters:
            slot, subslot, index = next(iter(self._parameters))
            raise ConfigError(f"slot {slot}, subslot 0x{subslot:04X} has no record {index} in the file")
        return tuple(record for _, record in sorted(self._records, key=lambda pair: pair[0]))


def from_gsdml(
    gsdml: Gsdml,
    *,
    dap: str | None = None,
    modules: Mapping[int, str | None] | None = None,
    submodules: Mapping[Place, str | None] | None = None,
    parameters: Parameters | None = None,
) -> PlannedDevice:
    """Plan a device.

    ``dap`` may be left out where the file has one.  ``modules`` gives slots their modules by ID, ``submodules`` places
    theirs; None leaves a place empty that a new project would fill.  ``parameters`` (slot, subslot, index) changes
    records from their defaults.  Raises :class:`ConfigError` for whatever the file does not allow.
    """
    access_point = _choose_dap(gsdml, dap)
    chosen: dict[int, dict[int, str | None]] = {}
    for (slot, subslot), target in (submodules or {}).items():
        chosen.setdefault(slot, {})[subslot] = target
    planner = _Planner(gsdml, parameters or {}, ioxs_required=access_point.ioxs_required)
    planner.plug(access_point.slot, access_point, chosen.pop(access_point.slot, {}))
    if access_point.slot in (modules or {}):
        raise ConfigError(f"slot {access_point.slot} is the access point's, modules are in other slots")
    filled = _contents(access_point.modules, modules or {}, access_point.physical_slots, "module", "slot")
    known = {module.id: module for module in gsdml.modules}
    for slot, target in sorted(filled.items()):
        module = known.get(target)
        if module is None:
            raise ConfigError(f"the file names module {target!r} for slot {slot} and does not describe it")
        planner.plug(slot, module, chosen.pop(slot, {}))
    if chosen:
        raise ConfigError(f"slot {next(iter(chosen))} has no module, submodules need one")
    return PlannedDevice(
        vendor_id=gsdml.vendor_id,
        device_id=gsdml.device_id,
        dap=access_point,
        submodules=tuple(planner.submodules.values()),
        records=planner.records(),
    )
