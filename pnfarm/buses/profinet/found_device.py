"""A station of a capture as a device of a farm file, by a GSDML file made of what was seen.

Each Connect of the capture is held against the device that comes of it, and what the farm's device would refuse is
said.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice, FoundStation
from pnfarm.buses.profinet.described.description import describe_plugged, with_serial_number
from pnfarm.buses.profinet.said import said_of
from pnfarm.buses.profinet.seen_device import few, seen_device
from pnfarm.buses.profinet.seen_gsdml import describe_seen, file_name
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.device.check import RefusedError, check_connect, check_plugged, parse_connect
from pnfarm.protocols.profinet.description import Plugged
from pnfarm.protocols.profinet.gsdml.safe_xml import MAX_OCTETS
from pnfarm.protocols.profinet.gsdml.station import plug_station
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.table.plain_data import PLAIN_OCTETS
from pnfarm.vocabulary.durations import format_duration
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pnfarm.buses.imports import Said
    from pnfarm.buses.profinet.decode.observed import SeenConnection, SeenStation
    from pnfarm.buses.profinet.seen_device import SeenDevice
    from pnfarm.protocols.profinet.description import DeviceDescription

__all__ = ["MOST_OCTETS", "found_device"]

#: Octets of all description files that are made of one capture.
MOST_OCTETS = 4 * MAX_OCTETS


def found_device(
    seen: SeenStation,
    connections: Sequence[SeenConnection],
    address: Mapping[str, Any],
    assumed: Sequence[str],
    facts: Sequence[str],
    octets: int,
) -> FoundDevice | FoundStation:
    """The device of these connections; one that cannot be described, in ``octets`` at most, is another station.

    ``address`` are the keys of its addresses, ``assumed`` what no frame says of them.
    """
    name = seen.name or f"device-{seen.mac.hex()[-6:]}"
    device = seen_device(connections)
    try:
        text, keys, refused = _described(seen, device, connections)
        if len(text) > octets:
            raise ConfigError("the capture has more devices than a farm can have")
    except ConfigError as exc:
        told = f"no device of a farm can accept it: {exc}"
        return FoundStation(name, (told, *device.notes, *facts), keys=address, said=_said(seen, device, connections))
    keys = {**address, **keys}
    notes = [
        *few(refused),
        "its data are octets, because a capture does not describe them: name them in `signals`",
        *assumed,
    ]
    keys |= _limits(device, connections, notes)
    return FoundDevice(
        name,
        DescriptionFile("gsdml", file_name(connections[0].time_ns), text.encode()),
        keys,
        (*notes, *device.notes),
        (*_differing(seen, connections), *facts),
        said=_said(seen, device, connections),
    )


def _said(seen: SeenStation, device: SeenDevice, connections: Sequence[SeenConnection]) -> Said:
    head = device.modules[device.head]
    return said_of(
        seen.name,
        connections[-1].numbers[:2],
        access_point=head.ident,
        slots=(
            (slot, one.ident, (sum(sub.inputs for sub in subs), sum(sub.outputs for sub in subs)))
            for slot, one in device.modules.items()
            if one is not head and one.is_there
            for subs in [one.submodules.values()]
        ),
        order_number=_text(next((im0.order_id for (slot, _), im0 in seen.im0.items() if slot == device.head), b"")),
    )


def _described(
    seen: SeenStation, device: SeenDevice, connections: Sequence[SeenConnection]
) -> tuple[str, dict[str, Any], list[str]]:
    """The file, its keys, and the connections that the farm's device refuses.

    Raises :class:`ConfigError` if there can be no such device.
    """
    for way in ("inputs", "outputs"):
        total = sum(getattr(one, way) for module in device.modules.values() for one in module.submodules.values())
        if total > PLAIN_OCTETS:
            raise ConfigError(f"it has {total} octets of {way}, at most {PLAIN_OCTETS} can be in a farm")
    gsdml = describe_seen(seen, device, connections)
    (dap,) = gsdml.daps
    # by their idents, so that a maker's file can take the place of this one
    there = {
        slot: module.ident if module.is_there else None
        for slot, module in sorted(device.modules.items())
        if slot != device.head
    }
    plugged = plug_station(gsdml, modules=there)
    described = with_serial_number(describe_plugged(plugged, strict=not device.lax), seen.mac)
    refused = [f"the farm's device refuses {why}" for one in connections if (why := _refusal(one, described))]
    keys: dict[str, Any] = {"access_point": f"0x{dap.ident:08X}"}
    return emit_gsdml(gsdml), keys | ({"slots": there} if there else {}), refused


def _refusal(connection: SeenConnection, described: DeviceDescription) -> str | None:
    """Why a farm's device does not take this Connect."""
    try:
        request = parse_connect(emit_blocks(connection.request), described)
        check_connect(request, described)
        check_plugged(request, {module.slot: module for module in Plugged(described).modules()})
    except RefusedError as exc:
        return f"the Connect of {connection.controller_name or format_mac(connection.controller)}: {exc.detail}"
    return None


def _limits(device: SeenDevice, connections: Sequence[SeenConnection], notes: list[str]) -> dict[str, Any]:
    """The fastest cycle, and whether the device takes more than what was seen."""
    fastest = min(connection.cycle_ns for connection in connections)
    keys: dict[str, Any] = {"cycle": format_duration(fastest)}
    # of the last connection with several CRs in a direction: two controllers may have each its own cycle
    several = next((one.cycles for one in reversed(connections) if len(one.iocrs) > 2), {})
    if slower := {slot: cycle_ns for slot, cycle_ns in sorted(several.items()) if cycle_ns > fastest}:
        keys["cycles"] = {slot: format_duration(cycle_ns) for slot, cycle_ns in slower.items()}
    if device.lax:
        notes += [f"{why}: limits are lax" for why in few(device.lax)]
        return keys | {"limits": "lax"}
    notes.append(f"`limits: lax` takes cycles below {format_duration(fastest)} and other parameter records as well")
    return keys


def _differing(seen: SeenStation, connections: Sequence[SeenConnection]) -> Iterator[str]:
    """What was seen of its identity and is not in the farm."""
    numbers = list(dict.fromkeys(connection.numbers for connection in connections))
    if len(numbers) > 1 or (seen.vendor, seen.device) != numbers[-1][:2]:
        said = "" if seen.vendor is None else f" and says 0x{seen.vendor:04X}/0x{seen.device or 0:04X} of itself"
        called = ", ".join(few([f"0x{vendor:04X}/0x{number:04X}/{instance}" for vendor, number, instance in numbers]))
        yield f"it is called as vendor/device/instance {called}{said}: the last call counts"
    if any(connection.accepted is False for connection in connections):
        yield "a connection was refused in the capture"
    if not seen.im0:
        yield "its I&M0 was not read: order number and releases are empty"
    yield from few([
        f"I&M0 of slot {slot}, subslot 0x{subslot:04X}: serial number {_text(im0.serial_number)}, revision counter "
        f"{im0.revision_counter}, profile 0x{im0.profile_id:04X}/0x{im0.profile_specific_type:04X}; the farm's device "
        "has its own"
        for (slot, subslot), im0 in sorted(seen.im0.items())
    ])  # fmt: skip
    if seen.ports:
        yield f"its ports by LLDP: {', '.join(few(seen.ports))}"


def _text(octets: bytes) -> str:
    return octets.decode("ascii", "replace").strip("\0 ")
