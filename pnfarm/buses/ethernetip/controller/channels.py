"""The cyclic connections of the scanner as rows of the channel tables."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.channels import ChannelRows
from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.parts import Piece
from pnfarm.protocols.enip.wire.encapsulation import IO_PORT
from pnfarm.table.channel import STATUS_GOOD, STATUS_RUN
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS, PART_HIGH, PART_LOW, word_code
from pnfarm.wire.mac import multicast_mac

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.buses.ethernetip.controller.device_plan import DevicePlan
    from pnfarm.buses.ethernetip.controller.session import DeviceSession
    from pnfarm.engine.columns import Columns
    from pnfarm.links.base import Port
    from pnfarm.links.sockets import SocketCarrier
    from pnfarm.protocols.enip.originator_events import ConnectionMade

__all__ = ["SessionChannels"]

_NS_PER_US = 1000
#: Octets of an assembly that the process image holds.
_HELD = 4 * ASSEMBLY_WORDS
#: Devices with the same interval are sent to in different ticks.
_SPREAD_NS = 1_000_000
#: DSCP 47 of priority Scheduled (CIP volume 2, 5-7.4), in the upper six bits.
_TOS = 47 << 2


def _carried(plan: DevicePlan, octets: int) -> dict[str, Any]:
    """How these octets of data are in the table: words of a drive's assembly (code, offset), or plain data."""
    if plan.plain:
        return {"words": (), "pieces": [Piece(0, 0, octets, None, octets)] if octets else ()}
    places = range(0, min(octets, _HELD) - 1, 2)
    return {"words": [(word_code(ASSEMBLY + at // 4, PART_HIGH if at % 4 else PART_LOW), at) for at in places]}


class SessionChannels(ChannelRows):
    """``port`` and ``address`` are the scanner's; groups are joined by its ``sockets``."""

    def __init__(self, columns: Columns, port: Port, address: IPv4Address, sockets: SocketCarrier) -> None:
        super().__init__(columns, port)
        self._address = address
        self._sockets = sockets
        #: Sessions of each group: in a large network, devices 1,024 addresses apart have the same.
        self._members: Counter[IPv4Address] = Counter()
        #: Whether the scanner is in run mode; else what it sends is idle.
        self.running = True

    def open(self, session: DeviceSession, made: ConnectionMade) -> None:
        """Forward_Open was answered: both directions start."""
        self.close(session)
        plan, wanted = session.plan, session.plan.connection
        device = plan.ip.ip
        ports = {item.o_to_t: item.port for item in made.items if item.port}
        groups = [item.address for item in made.items if not item.o_to_t and item.address.is_multicast]
        session.group = groups[0] if groups and wanted.multicast else None
        if session.group is not None:
            self._members[session.group] += 1
            self._sockets.join(self._port.index, session.group)
        self._columns.image[session.index].sent[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS] = 0
        common: dict[str, Any] = {"image": session.index, "port": self._port.index, "plain": session.index}
        output_rpi_ns = made.reply.o_to_t_api_us * _NS_PER_US
        provider = self._table.open_provider(
            Class1ProviderPlan(
                **common,
                destination=session.mac,
                source=self._port.mac,
                destination_address=device,
                source_address=self._address,
                connection_id=made.reply.o_to_t_id,
                data_length=wanted.output_octets,
                rpi_ns=output_rpi_ns,
                **_carried(plan, wanted.output_octets),
                run_idle=wanted.runs,
                phase_ns=session.index * _SPREAD_NS % output_rpi_ns,
                tos=_TOS,
                destination_port=ports.get(True, IO_PORT),
            )
        )
        session.providers.append(provider)
        self.set_mode(session, run=self.running)
        consumer = self._table.open_consumer(
            Class1ConsumerPlan(
                **common,
                destination=self._port.mac if session.group is None else multicast_mac(session.group),
                destination_address=self._address if session.group is None else session.group,
                source_address=device,
                connection_id=made.reply.t_to_o_id,
                data_length=wanted.input_octets,
                rpi_ns=made.reply.t_to_o_api_us * _NS_PER_US,
                multiplier=plan.timeout_multiplier,
                **_carried(plan, wanted.input_octets),
                run_idle=wanted.input_header,
            )
        )
        session.consumers.append(consumer)

    def close(self, session: DeviceSession) -> None:
        """Both directions end, and the group is left by its last session."""
        self.close_rows(session)
        group, session.group = session.group, None
        if group is not None:
            self._members[group] -= 1
            if not self._members[group]:
                del self._members[group]
                self._sockets.leave(self._port.index, group)

    def set_mode(self, session: DeviceSession, *, run: bool) -> None:
        """The run/idle header of what is sent, where it has one; the axis program of an idle scanner is stopped."""
        if session.provider is not None:
            self._columns.ppm[session.provider].data_status = STATUS_GOOD if run else STATUS_GOOD & ~STATUS_RUN
        self._columns.program[session.index].enable = run and session.plan.program.enable

    def awaited_ns(self, session: DeviceSession) -> int:
        """How long data were awaited of a connection that ended for want of them."""
        consumer = self._columns.cpm[session.consumers[0]]
        return int(consumer.hold_ns if consumer.received else consumer.first_hold_ns)

    def read(self, session: DeviceSession) -> bytes:
        """Input data of a drive that came last, as far as the image holds them."""
        words = self._columns.image[session.index].received[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS]
        return bytes(words.astype("<i4").tobytes()[: session.plan.connection.input_octets])
