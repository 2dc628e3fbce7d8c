"""The devices of a running farm in ``pnfarm inspect``: a table of all, and one in full."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.cli.farm_file import counted
from pnfarm.cli.inspected_connections import print_connections
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_line, print_section, print_table, seconds

if TYPE_CHECKING:
    from pnfarm.terminal.client import FarmClient

__all__ = ["listed_devices", "print_device", "print_devices"]

#: What a device says of a module that speaks a safety protocol.
_NO_SAFETY = "safe: the device does not run the safety protocol, so that its controller passivates it"


def listed_devices(farm: FarmClient) -> list[dict[str, Any]]:
    """Every device; none of a farm of an older version, which does not know of any."""
    try:
        found: list[dict[str, Any]] = farm.get("devices")["devices"]
    except ConfigError:
        return []
    return found


def print_devices(devices: list[dict[str, Any]]) -> None:
    """A line for each."""
    if devices:
        rows = [(one["name"], one["description"] or "-", _state(one), _address(one), one["mac"]) for one in devices]
        print_section(("DEVICE", "KIND", "STATE", "ADDRESS", "MAC"), rows)


def _address(device: dict[str, Any]) -> str:
    """On a network, or on a serial line."""
    station = device.get("station_address")
    return device["ip"] or ("-" if station is None else f"station {station}")


def _state(device: dict[str, Any]) -> str:
    return "connected" if device["connected"] else "waits" if device["powered"] else "off"


def print_device(device: dict[str, Any]) -> None:
    """One with its modules and its signals."""
    connection = device["connection"]
    controller = connection["controller"]
    cycle = connection["cycle_seconds"]
    rows = [
        ("name", device["name"]),
        ("station name", device["station_name"]),
        ("kind", device["description"] or "-"),
        ("access point", device["access_point"] or "-"),
        *((key.replace("_", " "), str(value)) for key, value in device["identity"].items()),
        ("mac", device["mac"]),
        ("address", _address(device)),
        ("state", _state(device)),
        ("connection", connection["state"]),
        ("controller", "-" if controller is None else controller["name"]),
        ("cycle", "-" if cycle is None else seconds(cycle)),
    ]
    named = {name for name, _ in rows}
    further = [(key.replace("_", " "), value) for key, value in device.get("details", {}).items()]
    rows += [(name, value) for name, value in further if isinstance(value, str) and value and name not in named]
    print_table(("FIELD", "~VALUE"), rows)
    submodules = [(module, one) for module in device["modules"] for one in module["submodules"]]
    print_section(
        ("PLACE", "MODULE", "SUBMODULE", ">IN", ">OUT", "~"),
        [
            (
                f"{module['slot']}.{one['subslot']}",
                module["name"],
                one["name"],
                str(one["input_octets"]),
                str(one["output_octets"]),
                _NO_SAFETY if one["safety"] else "",
            )
            for module, one in submodules
        ],
    )
    print_connections(device.get("details", {}).get("connections", []), "device")
    print_line(f"{counted(len(device['signals']), 'signal')}: `pnfarm io {device['name']}`")
