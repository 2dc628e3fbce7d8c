"""A PROFINET device of a project: its head, its name and its address."""

from __future__ import annotations

from ipaddress import AddressValueError, IPv4Address
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.project.names import name_on_network
from pnfarm.buses.projects.parts import head_of_file, nodes, type_of

if TYPE_CHECKING:
    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.buses.projects.view import ProjectView

__all__ = ["address_keys", "head_of", "name_notes", "name_of"]

_NONE = IPv4Address(0)


def head_of(device: CaexElement, project: ProjectView) -> CaexElement | None:
    """Its access point; of Siemens' devices the module whose interface is at an IO system."""
    interface = project.interface_at_system(device)
    if (head := head_of_file(device)) is not None or interface is None:
        return head
    # the interface itself may be in a bus adapter
    ordered = [one for one in interface.around() if type_of(one).order_number and "PositionNumber" in one.attributes]
    return ordered[-1] if ordered else None


def name_of(device: CaexElement) -> str:
    """The station's name on the network, else the device's in the project."""
    return name_on_network(_named(device)) or device.name


def name_notes(device: CaexElement) -> list[str]:
    """What to report of a station that has another name on the network than in the project."""
    own = _named(device)
    other = name_on_network(own)
    return [] if other == own.lower() else [f"{own!r} in the project, which TIA Portal writes as {other}"]


def _named(device: CaexElement) -> str:
    """What the project names the station; without such a name TIA Portal makes it of that of the device's head."""
    given = next((one.attributes.get("ProfinetDeviceName", "") for one in nodes(device)), "")
    heads = (one for one in device.walk() if one.attributes.get("DeviceItemType") in {"HeadModule", "CPU"})
    head = head_of_file(device) or next(heads, None)
    return given or (head.name if head is not None else "")


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except AddressValueError:
        return _NONE


def address_keys(device: CaexElement) -> dict[str, Any]:
    """``ip`` and ``gateway`` of a group, as far as the project has them."""
    keys: dict[str, Any] = {}
    for node in nodes(device)[:1]:
        ip, mask = (_address(node.attributes.get(key, "")) for key in ("NetworkAddress", "SubnetMask"))
        if int(ip) and int(mask):
            keys["ip"] = f"{ip}/{int(mask).bit_count()}"
            router = _address(node.attributes.get("RouterAddress", ""))
            if int(router) and router != ip:
                keys["gateway"] = str(router)
    return keys
