"""Data of class 1 connections: only changes give a line, unless every frame is requested.

Lines are given for the first datagram, the run/idle header, words of a position controller's assemblies, a silence
longer than a given number of intervals, missing datagrams, and a sequence count that does not change or goes back
(receivers ignore such data: CIP volume 1, chapter 3-4.4).  The channel keeps sums for the summary.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.decode.assemblies import changes, values
from pnfarm.buses.ethernetip.decode.channels import Channel
from pnfarm.buses.ethernetip.decode.names import octets_text
from pnfarm.captures.packet import Description
from pnfarm.protocols.enip.wire.class1 import Class1Pdu, parse_class1
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.octets import Reader
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.ethernetip.decode.shared import Shared
    from pnfarm.captures.packet import Packet
    from pnfarm.wire.ipv4 import Ipv4Packet

__all__ = ["cyclic"]

_HALF_SEQUENCE, _SEQUENCE = 1 << 31, (1 << 32) - 1
_HALF_COUNT, _COUNT = 1 << 15, (1 << 16) - 1


def cyclic(packet: Packet, shared: Shared) -> Iterator[Description]:
    """One datagram; most give no line.  Raises :class:`DecodeError` where it is not one of such a connection."""
    ip = parse_ipv4(packet.payload)
    pdu = parse_class1(parse_udp(ip.payload).data)
    channel = _channel(packet, ip, pdu, shared)
    template = channel.template
    data, header = pdu.data, None
    if template is not None and template.header and (data or not template.variable):
        r = Reader(data, little=True)
        header, data = r.u32(), r.rest()
    if template is not None and not template.fits(len(data)):
        yield from channel.limited("wrong length", f"{len(data)} octets, {template.octets} expected")
        return
    before = channel.data
    if channel.begun:
        yield from _time(channel, packet.time_ns, pdu, shared)
        if header is not None and channel.header is not None and (header ^ channel.header) & 1:
            yield from channel.limited("run/idle", _mode(header), before=channel.header, after=header)
        if template is not None and data != before and template.is_static(min(before, data, key=len)):
            for what, text, details in changes(before, data, template.model, from_device=template.from_device):
                yield from channel.limited(what, text, **details)
    channel.frames += 1
    first, channel.begun = not channel.begun, True
    channel.source, channel.destination = packet.source, packet.destination
    channel.last_ns, channel.sequence, channel.count = packet.time_ns, pdu.sequence, pdu.count
    channel.header, channel.data = header, data
    if first:
        details = {"connection_id": channel.connection_id, "octets": len(data)}
        yield Description("cyclic data begin", _first(channel), details)
    elif shared.capture.every_frame:
        text = f"0x{channel.connection_id:08X} sequence {pdu.sequence} count {pdu.count} {_values(channel)}"
        yield Description("cyclic", text.rstrip(), {"connection_id": channel.connection_id})


def _channel(packet: Packet, ip: Ipv4Packet, pdu: Class1Pdu, shared: Shared) -> Channel:
    """The channel of a Forward_Open, or one whose layout comes from the farm file, or one without a layout."""
    for key in ((ip.source, ip.destination, pdu.connection_id), (ip.source, None, pdu.connection_id)):
        channel = shared.channels.get(key)
        if channel is not None:
            shared.channels.move_to_end(key)
            return channel
    found = None
    for mac, from_device in ((packet.source, True), (packet.destination, False)):
        template = shared.templates.get((mac, from_device))
        if template is not None and len(pdu.data) == template.octets + 4 * bool(template.header):
            found = template
    key = (ip.source, ip.destination, pdu.connection_id)
    channel = shared.channels[key] = Channel(pdu.connection_id, found)
    return channel


def _mode(header: int) -> str:
    rest = f" (header 0x{header:08X})" if header & ~1 else ""
    return ("run" if header & 1 else "idle") + rest


def _first(channel: Channel) -> str:
    parts = [f"connection 0x{channel.connection_id:08X}"]
    template = channel.template
    if template is None:
        return f"{parts[0]}, {octets_text(channel.data)}; layout unknown, no Forward_Open in the capture"
    if template.assembly is not None:
        parts.append(f"assembly {template.assembly}")
    parts += [f"{template.octets} octets", f"RPI {template.rpi_ns / 1e6:g} ms"]
    if channel.header is not None:
        parts.append(_mode(channel.header))
    return ", ".join(parts) + (f"; {_values(channel)}" if template.octets else "")


def _values(channel: Channel) -> str:
    template = channel.template
    if template is None or not template.is_static(channel.data):
        return octets_text(channel.data)
    return values(channel.data, from_device=template.from_device)


def _time(channel: Channel, now: int, pdu: Class1Pdu, shared: Shared) -> Iterator[Description]:
    """Interval, number of the datagram, sequence count."""
    passed = channel.passed(now)
    missing = 0
    ahead = (pdu.sequence - channel.sequence) & _SEQUENCE
    if ahead != 1:
        if 1 < ahead < _HALF_SEQUENCE:
            missing = ahead - 1
            channel.missing += missing
        else:
            channel.jumps += 1
            text = f"{channel.sequence} -> {pdu.sequence}, {(channel.sequence + 1) & _SEQUENCE} expected"
            yield from channel.limited("datagram number", text, before=channel.sequence, after=pdu.sequence)
    yield from _count(channel, pdu)
    if channel.template is not None and channel.cycle_ns and passed > shared.capture.gap_cycles * channel.cycle_ns:
        text = f"a frame ({passed / channel.cycle_ns:.1f} intervals of {channel.cycle_ns / 1e6:g} ms)"
        if missing:
            text += f", {missing} frames missing by their numbers"
        text = channel.gap(passed, text, channel.template.timeout_ns, "timeout")
        yield from channel.limited("gap", text, seconds=passed / 1e9, missing=missing)
    elif missing:
        yield from channel.limited("missing", f"{missing} frames by their numbers", missing=missing)


def _count(channel: Channel, pdu: Class1Pdu) -> Iterator[Description]:
    """The 16-bit sequence count; a datagram that came again has its old one."""
    if pdu.sequence == channel.sequence:
        return
    step = (pdu.count - channel.count) & _COUNT
    if step == 0:
        if not channel.stands:
            channel.stands = True
            channel.jumps += 1
            text = f"stays at {pdu.count}: data that are the same to the receiver"
            yield from channel.limited("sequence count", text, count=pdu.count)
        return
    channel.stands = False
    if step >= _HALF_COUNT:
        channel.jumps += 1
        text = f"{channel.count} -> {pdu.count} (-{_COUNT + 1 - step})"
        yield from channel.limited("sequence count", text, before=channel.count, after=pdu.count)
