"""A drive's address: probed for before it is used, watched and defended after (RFC 5227; CIP volume 2, appendix F).

The address is the farm file's.  What carries the drive's sockets (the kernel, or the switch in memory) has it only
while :attr:`DeviceAddress.in_use` holds.  Timings are those of :mod:`pnfarm.protocols.ip.claim`, where a drive on
EtherNet/IP differs in one: it waits for the end of the probe (assumed, as the manual does not mention the detection).
"""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.ip.claim import AddressClaim, ClaimSign, ClaimState
from pnfarm.station.events import AddressConflict, AddressConflictOver, AddressNotUsed
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, ArpPacket, emit_arp, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_ARP, EthernetFrame, emit_ethernet, parse_ethernet
from pnfarm.wire.mac import BROADCAST, NIL

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.station.event import Event

__all__ = ["DeviceAddress"]

UNSPECIFIED: Final = IPv4Address(0)
#: A host announces its address against another one at most so often (RFC 5227, 1.1: DEFEND_INTERVAL).
DEFEND_NS: Final = 10_000_000_000
#: Attribute 11 of the TCP/IP Interface object: what the drive did when it found the conflict.
PROBING, ONGOING = 1, 2
_USED: Final = {ClaimState.BOUND, ClaimState.CONTESTED, ClaimState.RECHECKING}


class DeviceAddress:
    """``detects``: conflicts are detected; ``answers``: ARP requests are answered here, not by the link.

    ``conflict(octets)`` is called with attribute 11 for each conflict that is acted upon, not for each packet of one.
    """

    def __init__(
        self,
        ip: IPv4Address,
        mac: bytes,
        *,
        detects: bool,
        answers: bool,
        note: Callable[[int, Event], None],
        conflict: Callable[[bytes], None],
    ) -> None:
        self.ip = ip
        self.mac = mac
        self._detects = detects
        self._answers = answers
        self._note = note
        self._conflict = conflict
        self._claim = AddressClaim(mac)
        self._claim.ip = ip
        self._frames: list[bytes] = []
        self._defended: int | None = None
        #: The last conflicting packet, as in attribute 11.
        self._found = b""
        #: The other station, while there is one.
        self.conflict_mac: bytes | None = None

    @property
    def in_use(self) -> bool:
        """Whether the drive has the address now."""
        return self._claim.state in _USED

    def start(self, now: int) -> None:
        """The drive comes on the wire."""
        self._follow(ClaimSign.CLAIM if self._detects else ClaimSign.CONFIGURE, now)

    def receive(self, data: bytes, now: int) -> None:
        """One ARP frame; others and what cannot be read are left alone."""
        try:
            frame = parse_ethernet(data)
            if frame.ethertype != ETHERTYPE_ARP:
                return
            packet = parse_arp(frame.payload)
        except DecodeError:
            return
        if packet.sender_mac == self.mac or self._claim.state is ClaimState.NONE:
            return
        probed = packet.sender_ip == UNSPECIFIED and packet.target_ip == self.ip
        if self._detects and (packet.sender_ip == self.ip or (probed and not self.in_use)):
            self._object(packet, now)
        elif packet.operation == OPERATION_REQUEST and packet.target_ip == self.ip and self.in_use and self._answers:
            self._send(OPERATION_REPLY, self.ip, packet.sender_mac, packet.sender_ip, packet.sender_mac)

    def _object(self, packet: ArpPacket, now: int) -> None:
        """Another station has the address, or wants it at the same time."""
        activity = ONGOING if self.in_use else PROBING
        self.conflict_mac = packet.sender_mac
        self._found = bytes([activity]) + packet.sender_mac + emit_arp(packet)
        self._follow(ClaimSign.OBJECTION, now)

    def next_deadline(self) -> int | None:
        return self._claim.deadline

    def handle_timeout(self, now: int) -> None:
        if self._claim.deadline is not None and self._claim.deadline <= now:
            self._follow(ClaimSign.QUIET, now)

    def to_send(self) -> list[bytes]:
        """Whole frames."""
        frames, self._frames = self._frames, []
        return frames

    def _follow(self, sign: ClaimSign, now: int) -> None:
        other = self.conflict_mac or NIL
        match self._claim.sign(sign, now):
            case "ask":
                self._send(OPERATION_REQUEST, UNSPECIFIED, NIL, self.ip, BROADCAST)
            case "announce":
                self._announce()
            case "defend":
                if self._defended is None or now - self._defended >= DEFEND_NS:
                    self._defended = now
                    self._announce()
                    self._note(now, AddressConflict(self.ip, other))
                    self._conflict(self._found)
            case "refuse":
                self._conflict(self._found)
                self._note(now, AddressNotUsed(self.ip, other))
            case "take":
                self.conflict_mac = None
                self._announce()
                self._note(now, AddressConflictOver(self.ip))
            case "settle":
                self.conflict_mac = None
                self._note(now, AddressConflictOver(self.ip))

    def _announce(self) -> None:
        self._send(OPERATION_REQUEST, self.ip, NIL, self.ip, BROADCAST)

    def _send(self, operation: int, sender: IPv4Address, target_mac: bytes, target: IPv4Address, to: bytes) -> None:
        packet = ArpPacket(operation, self.mac, sender, target_mac, target)
        self._frames.append(emit_ethernet(EthernetFrame(to, self.mac, ETHERTYPE_ARP, emit_arp(packet))))
