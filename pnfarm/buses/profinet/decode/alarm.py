"""RTA-PDUs as text: the end of an AR, alarms, their acknowledgements, and transport PDUs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.errors import ConnectFault, RtaError, describe_status
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmAck, describe_place, parse_alarm
from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, error_status, parse_rta
from pnfarm.protocols.profinet.wire.alarms.texts import alarm_in_words
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["alarm"]

#: IEC 61158-6-10, coding of PDUType.Type.
_RTA_TYPES = {1: "DATA", 2: "NACK", 3: "ACK", 4: "ERR"}


def alarm(packet: Packet, shared: Shared) -> Iterator[Description]:
    """An RTA-PDU: the end of an AR with its reason, an alarm, its acknowledgement, or a transport PDU."""
    pdu = parse_rta(packet.payload)
    priority = "high" if pdu.frame_id == ALARM_HIGH else "low"
    if pdu.type == RtaType.ERR:
        status = error_status(pdu)
        text = describe_status(status).removeprefix("RTA error: ").removeprefix("RTA_ERR_CLS_PROTOCOL: ")
        counts = {"aborts": text}
        if (status.error_code1, status.error_code2) == (
            ConnectFault.RTA_ERR_CLS_PROTOCOL,
            RtaError.CONSUMER_DHT_EXPIRED,
        ):
            counts["watchdogs"] = ""
        yield Description("ERR-RTA", text + _silence(packet, shared), {"status": f"0x{int(status):08X}"}, counts)
        return
    numbers = f"sequence 0x{pdu.send_sequence:04X}, acknowledges 0x{pdu.ack_sequence:04X}"
    if pdu.type != RtaType.DATA:
        name = _RTA_TYPES.get(pdu.type, f"type {pdu.type}")
        yield Description(f"alarm {name}", f"{priority} priority, {numbers}")
        return
    content = parse_alarm(pdu.body)
    if isinstance(content, AlarmAck):
        text = "taken" if content.status.ok else describe_status(content.status)
        yield Description("AlarmAck", f"{describe_place(content)}: {text} ({priority} priority, {numbers})")
        return
    yield Description("Alarm", f"{alarm_in_words(content)} ({priority} priority, {numbers})", {}, {"alarms": ""})


def _silence(packet: Packet, shared: Shared) -> str:
    """Time since the other end's last cyclic frame: the cause of the abort if its frames stopped."""
    # an earlier connection may have had another frame id
    lasts = [
        channel.last_ns
        for (to, source, _), channel in shared.channels.items()
        if (to, source) == (packet.source, packet.destination) and channel.begun
    ]
    if not lasts:
        return ""
    ago = (packet.time_ns - max(lasts)) / 1e6
    return f"; last cyclic frame of {shared.stations.name(packet.destination)} {ago:.1f} ms ago"
