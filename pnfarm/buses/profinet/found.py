"""Stations of a capture as drives of a farm file: which model simulates each, and under which identity.

A model is chosen by vendor and device number, else by its vendor and the lengths of a telegram; what is not sure has a
note.  A station that is no drive of a known kind is a device (`found_device`) if it was connected; else it is listed.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import Found, FoundDevice, FoundDrive, FoundStation, drives_first
from pnfarm.buses.profinet.axis_slots import axis_stride
from pnfarm.buses.profinet.decode.identity import numbers_of
from pnfarm.buses.profinet.found_device import MOST_OCTETS, found_device
from pnfarm.buses.profinet.said import said_of
from pnfarm.buses.profinet.seen_device import few
from pnfarm.drives.catalogue import models_on
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.profinet.decode.decoder import ProfinetDecoder
    from pnfarm.buses.profinet.decode.observed import SeenConnection, SeenStation
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ExpectedSubmodule

__all__ = ["found"]

_INPUT, _OUTPUT = 1, 2
#: Only frames of DCP have the prefix length of an address.
_PREFIX = 24
_MS = 1e6


def found(decoder: ProfinetDecoder, *, models: bool = True) -> Iterator[Found]:
    """Stations that were connected, then others; controllers are named by their devices."""
    observed = decoder.shared.observed
    if observed is None:
        return iter(())
    connected: dict[bytes, list[SeenConnection]] = {}
    for connection in observed.connections.values():
        connected.setdefault(connection.device, []).append(connection)
    controllers = {connection.controller for connection in observed.connections.values()}
    vlans = decoder.shared.stations.vlans
    torn = Counter(call.server for call in decoder.shared.calls.values() if call.incomplete)
    others = [
        seen
        for seen in (observed.station(mac) for mac in dict.fromkeys((*observed.stations, *torn)))
        if seen.mac not in connected
        and seen.mac not in controllers
        and (seen.vendor is not None or seen.ip is not None or seen.mac in torn)
    ]
    octets = MOST_OCTETS
    stations: list[Found] = []
    for seen, connections in (
        *((observed.station(mac), connections) for mac, connections in connected.items()),
        *((seen, []) for seen in others),
    ):
        first = min((one.numbers[2] for one in connections), default=0)
        behind = [one for one in connections if one.numbers[2] != first]
        connections = [one for one in connections if one.numbers[2] == first]
        stations += [
            FoundStation(f"{seen.name or format_mac(seen.mac)}, instance {instance}", tuple(_behind(seen, asked)))
            for instance in sorted({one.numbers[2] for one in behind})
            for asked in [[one for one in behind if one.numbers[2] == instance]]
        ]
        # one that a device accepted says more than one that it refused
        last = max(reversed(connections), key=lambda one: bool(one.accepted), default=None)
        chosen = _model(seen, last) if models else None
        facts = tuple(_facts(seen, last, connections, vlans(seen.mac), torn[seen.mac]))
        one: Found
        if chosen is not None:
            one = _drive(seen, last, *chosen, facts)
        elif last is not None:
            one = found_device(seen, connections, *_address(seen), facts, octets)
            octets -= len(one.file.octets or b"") if isinstance(one, FoundDevice) else 0
        else:
            named = seen.name or format_mac(seen.mac)
            one = FoundStation(named, facts, keys=_address(seen)[0], said=said_of(seen.name, _numbers(seen)))
        stations.append(one)
    return drives_first(stations)


def _behind(seen: SeenStation, connections: Sequence[SeenConnection]) -> Iterator[str]:
    """Of a device that shares its interface with another one, as a proxy's do."""
    vendor, number, _ = connections[-1].numbers
    yield f"vendor 0x{vendor:04X}, device 0x{number:04X}, behind the interface of MAC {format_mac(seen.mac)}"
    yield "a device of a farm has an interface of its own"
    yield _connected(connections[-1])
    yield from few(_modules(connections[-1].apis))


def _address(seen: SeenStation) -> tuple[dict[str, Any], list[str]]:
    """The keys of a group for its addresses, and what is assumed."""
    keys: dict[str, Any] = {"mac": format_mac(seen.mac)}
    if seen.ip is not None and seen.mask is not None:
        keys["ip"] = f"{seen.ip}/{int(seen.mask).bit_count()}"
        if seen.gateway is not None and int(seen.gateway) and seen.gateway != seen.ip:
            keys["gateway"] = str(seen.gateway)
    elif seen.called is not None and int(seen.called):
        keys["ip"] = f"{seen.called}/{_PREFIX}"
        return keys, [f"no frame has its prefix length: /{_PREFIX} is assumed"]
    return keys, []


def _drive(
    seen: SeenStation,
    connection: SeenConnection | None,
    drive_model: Model,
    notes: list[str],
    facts: tuple[str, ...],
) -> FoundDrive:
    keys, assumed = _address(seen)
    notes += assumed
    identity = _identity(drive_model, seen, connection, notes)
    if identity:
        keys["identity"] = identity
    if axes := _axes(drive_model, connection):
        keys["axes"] = axes
        if len(axes) > drive_model.limits.axes:
            keys["limits"] = "lax"
    if connection is not None:
        least, most = drive_model.limits.min_cycle_ns, drive_model.limits.max_cycle_ns
        if connection.cycle_ns < least or 0 < most < connection.cycle_ns:
            keys["limits"] = "lax"
            allowed = f"{least / _MS:g} ms and more" if connection.cycle_ns < least else f"{most / _MS:g} ms and less"
            notes.append(f"its cycle of {connection.cycle_ns / _MS:g} ms is not the manual's {allowed}: limits are lax")
        if connection.accepted is False:
            notes.append("its connection was refused in the capture")
        elif connection.difference is not None:
            notes.append("it answered that modules differ from the project's")
    telegrams = {
        api.slot: telegram.number
        for api, data in _with_data(connection)
        if (telegram := _telegram(drive_model, api, data)) is not None
    }
    said = said_of(seen.name, _numbers(seen), telegrams=telegrams)
    return FoundDrive(
        seen.name or f"drive-{seen.mac.hex()[-6:]}", drive_model.name, keys, tuple(notes), facts, said=said
    )


def _numbers(seen: SeenStation) -> tuple[int, int] | None:
    return None if seen.vendor is None else (seen.vendor, seen.device or 0)


def _model(seen: SeenStation, connection: SeenConnection | None) -> tuple[Model, list[str]] | None:
    known = models_on("profinet")
    same = [one for one in known if numbers_of(one) == (seen.vendor, seen.device)]
    if same:
        names = ", ".join(one.name for one in same[1:])
        return same[0], [f"{names} has the same vendor and device number"] if names else []
    of_vendor = [one for one in known if one.profidrive.identity.vendor_id == seen.vendor]
    if not of_vendor:
        return None
    lengths = {_lengths(submodule) for _, submodule in _with_data(connection)}
    fitting = [one for one in of_vendor if lengths & {_words(t) for t in one.profidrive.telegrams.values()}]
    if connection is not None and not fitting:
        return None
    chosen = (fitting or of_vendor)[0]
    number = seen.device if seen.device is not None else 0
    return chosen, [f"chosen by its vendor: no model has device number 0x{number:04X}"]


def _axes(drive_model: Model, connection: SeenConnection | None) -> list[dict[str, Any]]:
    """The axes of a drive with a telegram in each of several slots."""
    found: dict[int, int] = {}
    for api, data in _with_data(connection):
        if (telegram := _telegram(drive_model, api, data)) is not None:
            found.setdefault(api.slot, telegram.number)
    if len(found) < 2 or axis_stride(drive_model) > 1:
        return []
    return [{"name": f"axis-{slot}", "slot": slot, "telegram": number} for slot, number in sorted(found.items())]


def _with_data(connection: SeenConnection | None) -> list[tuple[ExpectedApi, ExpectedSubmodule]]:
    if connection is None:
        return []
    return [(api, one) for api in connection.apis for one in api.submodules if api.slot and any(_lengths(one))]


def _lengths(submodule: ExpectedSubmodule) -> tuple[int, int]:
    """Octets to the controller, and from it."""
    sums = {_INPUT: 0, _OUTPUT: 0}
    for one in submodule.data:
        sums[one.direction] = sums.get(one.direction, 0) + one.data_length
    return sums[_INPUT], sums[_OUTPUT]


def _words(telegram: Telegram) -> tuple[int, int]:
    return 2 * len(telegram.input), 2 * len(telegram.output)


def _identity(
    drive_model: Model, seen: SeenStation, connection: SeenConnection | None, notes: list[str]
) -> dict[str, Any]:
    """What differs from the model's own."""
    own = drive_model.profidrive.identity
    different: dict[str, Any] = {}
    if seen.vendor is not None and seen.vendor != own.vendor_id:
        different["vendor"] = seen.vendor
    if seen.device is not None and seen.device != own.device_id:
        different["device"] = seen.device
    if seen.station_type and seen.station_type != own.station_type:
        different["station_type"] = seen.station_type
    if connection is None:
        return different
    for api in connection.apis:
        if api.slot == 0:
            if api.module_ident != drive_model.dap.ident:
                different["dap"] = api.module_ident
            known = {one.subslot: one.ident for one in drive_model.dap.submodules}
            for one in api.submodules:
                if one.subslot not in known:
                    notes.append(f"subslot 0x{one.subslot:04X} of its access point is not the model's")
                elif one.submodule_ident != known[one.subslot]:
                    different.setdefault("dap_submodules", {})[one.subslot] = one.submodule_ident
    for api, data in _with_data(connection):
        telegram = _telegram(drive_model, api, data)
        if telegram is None:
            told = f"slot {api.slot}, module 0x{api.module_ident:08X}: {'/'.join(map(str, _lengths(data)))} octets"
            notes.append(f"{told} in and out match no telegram")
            continue
        notes.append(f"telegram {telegram.number} in slot {api.slot}")
        if all(module.ident != api.module_ident for module in telegram.modules):
            different.setdefault("telegrams", {})[telegram.number] = {
                "module": api.module_ident,
                "submodule": data.submodule_ident,
            }
            points = [one for one in api.submodules if one is not data and not any(_lengths(one))]
            usual = min(telegram.module.submodules, key=lambda one: one.subslot).ident
            if points and points[0].submodule_ident != usual:
                different["access_point"] = points[0].submodule_ident
    return different


def _telegram(drive_model: Model, api: ExpectedApi, data: ExpectedSubmodule) -> Telegram | None:
    """By the module's ident, else by the lengths; of several, the one whose number an ident ends in."""
    idents = {one.subslot: one.submodule_ident for one in api.submodules}
    if (known := drive_model.profidrive.telegram_by_module(api.module_ident, idents)) is not None:
        return known
    fitting = [one for one in drive_model.profidrive.telegrams.values() if _words(one) == _lengths(data)]
    if len(fitting) > 1:
        fitting = [t for t in fitting if t.number in {data.submodule_ident & 0xFFFF, api.module_ident & 0xFFF}]
    return fitting[0] if len(fitting) == 1 else None


def _facts(
    seen: SeenStation, connection: SeenConnection | None, connections: Sequence[SeenConnection], vlans: str, torn: int
) -> list[str]:
    """``connection`` is the one of its ``connections`` that counts; ``torn`` calls to it lack fragments."""
    facts = []
    for what, had in (("was called", seen.names), ("had the address", seen.addresses)):
        if len(had) > 1:
            facts.append(f"it {what} {', then '.join(map(str, had))}: the last one counts")
    if vlans:
        facts.append(f"on {vlans}: the farm's link has to be in it")
    if torn:
        facts.append(f"{torn} calls to it lack fragments: their contents are not known")
    if seen.vendor is not None:
        facts.append(f"vendor 0x{seen.vendor:04X}, device 0x{seen.device or 0:04X}")
    if seen.station_type:
        facts.append(f"type {seen.station_type}")
    facts.append(f"MAC {format_mac(seen.mac)}" + (f", IP {seen.ip}" if seen.ip is not None else ""))
    if connection is not None:
        # the last of each controller
        others = {one.controller: one for one in connections}
        others.pop(connection.controller, None)
        facts += [_connected(connection), *few([f"also {_connected(one)}" for one in others.values()])]
        facts += _modules(connection.apis)
        if connection.parameters:
            indexes = sorted({place[3] for place in connection.parameters})
            told = ", ".join(f"0x{index:04X}" for index in indexes[:8]) + (" ..." if len(indexes) > 8 else "")
            facts.append(f"{len(connection.parameters)} start-up records: {told}")
    return facts


def _connected(connection: SeenConnection) -> str:
    start = "advanced" if connection.advanced else "legacy"
    every = sorted({connection.cycle_ns, *connection.cycles.values()})
    cycles = " and ".join(f"{cycle_ns / _MS:g} ms" for cycle_ns in every)
    return (
        f"connected by {connection.controller_name or format_mac(connection.controller)}: cycle {cycles}, "
        f"watchdog {connection.watchdog_factor} cycles, {start} start-up"
    )


def _modules(apis: Sequence[ExpectedApi]) -> list[str]:
    told = []
    for api in apis:
        data = ", ".join(
            f"0x{one.subslot:04X}: 0x{one.submodule_ident:08X} {'/'.join(map(str, _lengths(one)))}"
            for one in api.submodules
        )
        told.append(f"slot {api.slot}: module 0x{api.module_ident:08X} ({data})")
    return told
