"""DCP as text: Identify, Get, Set and Hello with their blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.decode.identity import learn_identity
from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.wire.dcp import blocks
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_GET,
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    parse_dcp,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["dcp"]

_SERVICES = {SERVICE_GET: "Get", SERVICE_SET: "Set", SERVICE_IDENTIFY: "Identify", SERVICE_HELLO: "Hello"}
_OPTIONS = {
    blocks.MacBlock.ID: "MAC address",
    blocks.IpParameterBlock.ID: "IP",
    blocks.FullIpSuiteBlock.ID: "IP suite",
    blocks.StationTypeBlock.ID: "station type",
    blocks.NameBlock.ID: "name",
    blocks.DeviceIdBlock.ID: "device id",
    blocks.DeviceRoleBlock.ID: "role",
    blocks.DeviceOptionsBlock.ID: "options",
    blocks.AliasBlock.ID: "alias",
    blocks.DeviceInstanceBlock.ID: "instance",
    blocks.OemDeviceIdBlock.ID: "OEM device id",
    blocks.StartBlock.ID: "start of transaction",
    blocks.StopBlock.ID: "end of transaction",
    blocks.SignalBlock.ID: "signal",
    blocks.FactoryResetBlock.ID: "factory reset",
    blocks.ResetToFactoryBlock.ID: "reset to factory",
    blocks.DeviceInitiativeBlock.ID: "device initiative",
    blocks.AllSelectorBlock.ID: "all",
}
#: Settings for which the qualifier's first bit says whether they are permanent.
_KEPT = (blocks.NameBlock, blocks.IpParameterBlock, blocks.FullIpSuiteBlock)


def dcp(packet: Packet, shared: Shared) -> Iterator[Description]:
    """One DCP frame; raises :class:`DecodeError` if it is not one."""
    pdu = parse_dcp(packet.payload)
    service = _SERVICES.get(pdu.service_id, f"service {pdu.service_id}")
    request = pdu.service_type == TYPE_REQUEST
    what = f"DCP {service}" if pdu.service_id == SERVICE_HELLO else f"DCP {service}.{'req' if request else 'res'}"
    _learn(packet, pdu, shared)
    if request:
        texts = [*(_option(option) for option in pdu.requested), *(_block(block, pdu) for block in pdu.blocks)]
    elif pdu.service_type != TYPE_SUCCESS:
        texts = ["service not supported"]
    else:
        texts = [_block(block, pdu) for block in pdu.blocks]
    yield Description(what, ", ".join(texts), {"xid": pdu.xid}, {what: ""})


def _learn(packet: Packet, pdu: DcpPdu, shared: Shared) -> None:
    stations = shared.stations
    if pdu.service_id == SERVICE_SET:
        if pdu.service_type == TYPE_REQUEST:
            shared.dcp_sets[packet.source, pdu.xid] = pdu.blocks
            return
        wanted = shared.dcp_sets.pop((packet.destination, pdu.xid), ())
        done = {b.subject for b in pdu.blocks if isinstance(b, blocks.ResponseBlock) and b.error == 0}
        found = [block for block in wanted if block.option_id in done]
    elif pdu.service_type == TYPE_REQUEST and pdu.service_id != SERVICE_HELLO:
        return
    else:
        found = list(pdu.blocks)
    if shared.observed is not None:
        shared.observed.said(packet.source, found)
    for block in found:
        match block:
            case blocks.NameBlock(name):
                stations.learn(packet.source, name=name)
            case blocks.DeviceIdBlock(vendor, device):
                learn_identity(stations, packet.source, vendor, device)


def _option(option: blocks.OptionId) -> str:
    return _OPTIONS.get(option, f"option {option.option}/{option.suboption}")


def _block(block: blocks.Block, pdu: DcpPdu) -> str:
    text = _value(block)
    if pdu.service_id == SERVICE_SET and pdu.service_type == TYPE_REQUEST and isinstance(block, _KEPT):
        text += " (permanent)" if (block.info or 0) & blocks.PERMANENT else " (until power off)"
    return text


def _value(block: blocks.Block) -> str:
    match block:
        case blocks.ResponseBlock(subject, error):
            try:
                result = blocks.BlockError(error).name.lower().replace("_", " ")
            except ValueError:
                result = f"error {error}"
            return f"{_option(subject)}: {'OK' if error == 0 else result}"
        case blocks.NameBlock(name):
            return f"name {name}" if name else "no name"
        case blocks.IpParameterBlock(address, mask, gateway) | blocks.FullIpSuiteBlock(address, mask, gateway):
            if not int(address):
                return "no IP"
            conflict = " in conflict" if (block.info or 0) & blocks.IP_CONFLICT else ""
            return f"IP {address} mask {mask} gateway {gateway}{conflict}"
        case blocks.StationTypeBlock(text):
            return f"type {text}"
        case blocks.AliasBlock(text):
            return f"alias {text}"
        case blocks.DeviceIdBlock(vendor, device) | blocks.OemDeviceIdBlock(vendor, device):
            return f"vendor 0x{vendor:04X} device 0x{device:04X}"
        case blocks.DeviceRoleBlock(role):
            names = ("IO device", "IO controller", "multidevice", "supervisor")
            return "role " + (" and ".join(n for bit, n in enumerate(names) if role & 1 << bit) or f"{role}")
        case blocks.DeviceInstanceBlock(high, low):
            return f"instance {high << 8 | low}"
        case blocks.ResetToFactoryBlock():
            return f"reset to factory, mode {block.mode}"
        case blocks.DeviceOptionsBlock(options):
            return f"{len(options)} options"
        case blocks.DeviceInitiativeBlock(value):
            return "sends Hello" if value & 1 else "sends no Hello"
    return _option(block.option_id)
