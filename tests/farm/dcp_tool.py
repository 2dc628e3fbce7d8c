"""An engineering station on the switch of a virtual line."""

from ipaddress import IPv4Interface

from pnfarm.protocols.ip.host import IpHost
from pnfarm.protocols.profinet.dcp.client import DcpClient, IdentifyAnswered
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    IpParameterBlock,
)
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet


class Tool:
    """An engineering station: DCP, and an address that it may use like any host."""

    def __init__(self, line, mac="020000fffffe"):
        self.line = line
        self.mac = bytes.fromhex(mac)
        self.dcp = DcpClient(self.mac)
        self.ip = IpHost(self.mac)
        self.port = line.world.switch.attach(self.mac, self._receive)
        self.found = []

    def _receive(self, _, octets, now):
        frame = parse_ethernet(octets)
        (self.dcp if frame.ethertype == ETHERTYPE_PROFINET else self.ip).receive(frame, now)
        self.send_pending(now)

    def send_pending(self, now):
        for octets in (*self.dcp.to_send(now), *self.ip.to_send(now)):
            self.line.world.switch.send(self.port.index, octets, now)
        self.found += self.dcp.events()

    def set(self, *blocks, drive=0, mac=b""):
        """Results of a Set, block by block; of a station with another ``mac`` instead of a drive."""
        now = self.line.world.now
        self.dcp.set_blocks(mac or self.line.farm.axes[drive].port.mac, blocks, now=now)
        self.send_pending(now)
        self.line.run(0.02)
        finished = self.found.pop()
        return [block.error for block in finished.results]

    def identify(self):
        """What every drive says, by its MAC address."""
        now = self.line.world.now
        self.dcp.identify(now=now)
        self.send_pending(now)
        self.line.run(0.02)
        answers = {event.mac: event.info for event in self.found if isinstance(event, IdentifyAnswered)}
        self.found.clear()
        return answers

    def use(self, address):
        self.ip.set_address(IPv4Interface(address) if address else None)
        self.send_pending(self.line.world.now)
        self.line.run(0.02)


def address(text, prefix=23, *, permanent=True):
    interface = IPv4Interface(f"{text}/{prefix}")
    return IpParameterBlock(interface.ip, interface.netmask, interface.ip, int(permanent))
