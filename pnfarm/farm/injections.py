"""Injections into the drives of a farm: their manager, and the ``impair:`` sections of a farm file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING

from pnfarm.buses.bus import InjectionHost
from pnfarm.buses.registry import bus, fault_kinds
from pnfarm.config.device import DeviceConfig
from pnfarm.drives import catalogue as drive_catalogue
from pnfarm.errors import ConfigError
from pnfarm.farm.events import AddressNotRestored, CarrierNotChanged
from pnfarm.faults.effects.addresses import Addresses
from pnfarm.faults.effects.carrier import Carriers
from pnfarm.faults.manager import InjectionManager
from pnfarm.faults.when import Conditions
from pnfarm.vocabulary.globs import means

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.impairment import Impairment
    from pnfarm.engine.channels.impairments import ImpairmentTable
    from pnfarm.engine.columns import Columns
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.gate.gate import GatedLink
    from pnfarm.faults.gate.socket_gate import SocketGate
    from pnfarm.links.base import Clock
    from pnfarm.signals.owner import SignalOwner
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.station import Station

__all__ = ["add_impairments", "make_manager"]


class _Drives(Mapping[str, "InjectedDrive"]):
    """The drives of each station, made by ``make`` when the first injection looks at them: few farms inject in all."""

    def __init__(self, stations: Sequence[Station], make: Callable[[Station], Sequence[InjectedDrive]]) -> None:
        self._make = make
        self._stations = {name: station for station in stations for name in station.names}
        self._made: dict[str, InjectedDrive] = {}

    def __getitem__(self, name: str) -> InjectedDrive:
        if name not in self._made:
            self._made.update((drive.name, drive) for drive in self._make(self._stations[name]))
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._stations)

    def __len__(self) -> int:
        return len(self._stations)


def make_manager(
    stations: Sequence[Station],
    axes: Sequence[Axis],
    owners: Mapping[str, SignalOwner],
    columns: Columns,
    impairments: ImpairmentTable,
    gate: GatedLink,
    sockets: SocketGate,
    *,
    settle: Callable[[Station, int], None],
    log: EventLog,
    clock: Clock,
) -> InjectionManager:
    """The manager of a farm whose ``stations`` are behind ``gate``, and behind ``sockets`` with their streams.

    ``owners``: what conditions find signals by.  ``settle(station, now)`` lets a station process the effects of an
    injection.
    """

    def not_changed(drive: str, reason: str) -> None:
        log.record(clock(), drive, CarrierNotChanged(reason))

    def not_restored(drive: str, reason: str) -> None:
        log.record(clock(), drive, AddressNotRestored(reason))

    carriers = Carriers(gate.inner, not_changed)
    addresses = Addresses(gate.inner, not_restored)

    def make(station: Station) -> Sequence[InjectedDrive]:
        host = InjectionHost(columns, impairments, gate, carriers, addresses, partial(settle, station), sockets)
        return bus(station.bus).injected_drives(station.device, host)

    drives = _Drives(stations, make)
    for station in stations:
        if bus(station.bus).uses_sockets:
            # the messages of a stream are cut from its beginning
            drives[station.configured_name]
    return InjectionManager(fault_kinds(), drives, (gate, sockets, addresses), Conditions(axes, columns, owners))


def add_impairments(
    manager: InjectionManager, drives: Sequence[DriveConfig | DeviceConfig], now: int, *, part: bool = False
) -> None:
    """Put the ``impair:`` sections of a farm file in force; ``drives`` are devices, too.

    ``part``: they are not all of the file's.

    Raises :class:`ConfigError` that names the group's drives.
    """
    groups: dict[tuple[str, int], list[DriveConfig | DeviceConfig]] = {}
    for drive in drives:
        word = "devices" if isinstance(drive, DeviceConfig) else "drives"
        groups.setdefault((word, drive.group), []).append(drive)
    for (word, _), members in groups.items():
        for index, impairment in enumerate(members[0].impair):
            names = _within(impairment, members)
            where = f"impair[{index}] of {word} {members[0].name} to {members[-1].name}"
            if not names and part:
                # they mean drives of other shards
                continue
            if not names:
                raise ConfigError(f"{where}: `on` means none of them; allowed: globs over their names, or leave it out")
            try:
                manager.inject({**impairment.as_dict(), "on": names}, now)
            except ConfigError as exc:
                raise ConfigError(f"{where}: {exc}") from exc


def _within(impairment: Impairment, members: Sequence[DriveConfig | DeviceConfig]) -> list[str]:
    if impairment.on is None:
        return [drive.name for drive in members]

    # all of a group are of one model
    if isinstance(members[0], DeviceConfig):
        models = members[0].kinds
    else:
        model = drive_catalogue.model(members[0].model)
        models = (model.name, *model.aliases)
    names = (name for drive in members for name in drive.names)
    return [name for name in names if any(means(glob, (name,), models) for glob in impairment.on)]
