"""A second station with a drive's address or name, at the drive's own port: an IP host or a DCP responder.

It hears what the drive's port sends and receives, and what it sends reaches the segment and the drive.  Frames to its
own MAC address arrive only where the link brings them to this port.
"""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import ParamSpec
from pnfarm.protocols.ip.host import IpHost
from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.wire.ethernet import ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_PROFINET, parse_ethernet
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.dcp.rules import DcpIdentity
    from pnfarm.wire.direction import Direction
    from pnfarm.wire.ethernet import EthernetFrame

__all__ = ["MAC", "NEIGHBOUR", "Neighbour", "SecondHost", "SecondName"]

MAC = ParamSpec(
    "mac",
    "MAC address of the second station; left out, a locally administered one that is always the same for a drive.",
)


class Neighbour(DrivePart):
    """The drive's address and name, as another station could have them."""

    def __init__(self, station: ProfinetDevice) -> None:
        self._station = station

    @property
    def mac(self) -> bytes:
        return self._station.port.mac

    @property
    def name(self) -> str:
        """Its present station name."""
        return self._station.dcp.name

    @property
    def address(self) -> IPv4Interface | None:
        """The address that it uses, or would use if no other station had it."""
        return self._station.ip.wanted

    @property
    def conflict_mac(self) -> bytes | None:
        """The station that the drive has found to use its address."""
        return self._station.addressing.conflict_mac

    @property
    def identity(self) -> DcpIdentity:
        return self._station.dcp.identity


NEIGHBOUR: Part[Neighbour] = Part("IP address and station name of PROFINET")


class SecondStation(Effect):
    """Base of both: it hears, speaks, and is counted."""

    wire = WIRE
    original = NEIGHBOUR

    def prepare(self) -> None:
        #: Frames for the drive itself, handed over when the drive is not in the middle of a step.
        self._for_drive: list[bytes] = []
        digest = hashlib.sha256(b"second station" + self.original.mac).digest()
        self.mac: bytes = self.values["mac"] or b"\x02" + digest[:5]
        if self.mac == self.original.mac:
            what = f"{format_mac(self.mac)} is the address of {self.drive.name} itself"
            raise InjectionError([("params.mac", what, "that of another station")])

    @abstractmethod
    def _take(self, frame: EthernetFrame, now: int) -> None:
        """Pass a frame to the machine."""

    @abstractmethod
    def _to_send(self, now: int) -> list[bytes]:
        """What the machine sends now."""

    @abstractmethod
    def _machine_deadline(self) -> int | None:
        """When the machine is to be asked again."""

    def begin(self, now: int) -> None:
        self.wire.listen(self._hear)
        self._speak(now)

    def _hear(self, direction: Direction, frame: bytes, now: int) -> None:
        del direction
        try:
            parsed = parse_ethernet(frame)
        except DecodeError:
            # the drive counts it
            return
        if parsed.source != self.mac and parsed.ethertype in {ETHERTYPE_ARP, ETHERTYPE_IPV4, ETHERTYPE_PROFINET}:
            self._take(parsed, now)
            self._speak(now)

    def _speak(self, now: int) -> None:
        for frame in self._to_send(now):
            to = frame[:6]
            if to != self.original.mac:
                self.wire.send_beside(frame)
            if to[0] & 1 or to == self.original.mac:
                self._for_drive.append(frame)
            self.tally.note(now, confirmed=not self.wire.carrier_off)

    def check(self, now: int) -> None:
        self._speak(now)
        frames, self._for_drive = self._for_drive, []
        for frame in frames:
            self.wire.deliver(frame, now)

    def take(self) -> None:
        self.wire.unlisten(self._hear)
        self._for_drive.clear()

    def next_deadline(self) -> int | None:
        if self._for_drive:
            # at once
            return 0
        return self._machine_deadline()


class SecondHost(SecondStation):
    """Has the drive's IP address: announces it every so often, answers ARP and ping, defends it."""

    def prepare(self) -> None:
        super().prepare()
        address = self.original.address
        if address is None:
            why = f"{self.drive.name} has no IP address that a second station could have"
            raise InjectionError([("kind", why, "")])
        self._address = address
        self._host = IpHost(self.mac)

    def begin(self, now: int) -> None:
        self._announce(now)
        super().begin(now)

    def _announce(self, now: int) -> None:
        self._host.set_address(self._address)
        self._announce_ns: int = now + self.values["every"]

    def _take(self, frame: EthernetFrame, now: int) -> None:
        if frame.ethertype != ETHERTYPE_PROFINET:
            self._host.receive(frame, now)
            self._host.events()

    def _to_send(self, now: int) -> list[bytes]:
        return self._host.to_send(now)

    def check(self, now: int) -> None:
        if now >= self._announce_ns:
            self._announce(now)
        super().check(now)

    def _machine_deadline(self) -> int | None:
        due = self._host.next_deadline()
        return self._announce_ns if due is None else min(due, self._announce_ns)


class SecondName(SecondStation):
    """Has the drive's station name, of the same type, without an address: answers DCP Identify."""

    def prepare(self) -> None:
        super().prepare()
        if not self.original.name:
            why = f"{self.drive.name} has no station name that a second station could have"
            raise InjectionError([("kind", why, "")])
        self._device = DcpDevice(self.mac, self.original.identity, name=self.original.name)

    def _take(self, frame: EthernetFrame, now: int) -> None:
        # what is not DCP is not for it
        if frame.ethertype == ETHERTYPE_PROFINET:
            self._device.receive(frame, now)
            self._device.events()

    def _to_send(self, now: int) -> list[bytes]:
        return self._device.to_send(now)

    def _machine_deadline(self) -> int | None:
        return self._device.next_deadline()
