"""What a controller expects of a port, compared with what the port sees (IEC 61158-5-10, PDev: checks of a port).

:func:`compare` is pure: PDPortDataCheck, the port as it is, its neighbours; out come the channel errors that hold now
(IEC 61158-6-10, coding of ChannelErrorType and ExtChannelErrorType).  Line delays and synchronisation are not measured
by a drive of conformance class B: these checks are kept and read back, and find nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.lldp.tlvs import MAU_100BASE_TX_FULL_DUPLEX
from pnfarm.protocols.profinet.wire.records.pdev import MediaType
from pnfarm.protocols.profinet.wire.records.pdev_port import (
    CheckLinkState,
    CheckMauType,
    CheckMauTypeDifference,
    CheckPeers,
    LinkStateLink,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.protocols.profinet.lldp.agent import Neighbour
    from pnfarm.protocols.profinet.wire.block import Block
    from pnfarm.protocols.profinet.wire.records.pdev_port import ExpectedPeer

__all__ = [
    "ChannelErrorType",
    "CheckFailed",
    "CheckPassed",
    "Finding",
    "PortCounters",
    "PortFacts",
    "RemoteMismatch",
    "compare",
    "media_type_of",
]


class ChannelErrorType(IntEnum):
    """ChannelErrorType of a port."""

    DATA_TRANSMISSION_IMPOSSIBLE = 0x8000
    REMOTE_MISMATCH = 0x8001


class DataTransmission(IntEnum):
    """ExtChannelErrorType under DATA_TRANSMISSION_IMPOSSIBLE."""

    LINK_STATE_MISMATCH = 0x8000
    MAU_TYPE_MISMATCH = 0x8001
    LINE_DELAY_MISMATCH = 0x8002


class RemoteMismatch(IntEnum):
    """ExtChannelErrorType under REMOTE_MISMATCH."""

    PEER_STATION_NAME = 0x8000
    PEER_PORT_NAME = 0x8001
    PEER_RT_CLASS_3 = 0x8002
    PEER_MAU_TYPE = 0x8003
    PEER_MRP_DOMAIN = 0x8004
    NO_PEER_DETECTED = 0x8005
    PEER_LINE_DELAY = 0x8007
    PEER_PTCP = 0x8008
    PEER_PREAMBLE_LENGTH = 0x8009
    PEER_FRAGMENTATION = 0x800A


@dataclass(frozen=True, slots=True)
class PortCounters:
    """ifInOctets ... ifOutErrors of a port, as the link counts them."""

    in_octets: int = 0
    out_octets: int = 0
    in_discards: int = 0
    out_discards: int = 0
    in_errors: int = 0
    out_errors: int = 0


@dataclass(frozen=True, slots=True)
class PortFacts:
    """A port as it is now.

    A virtual interface has no speed: ``mau_type`` is what the drive's own port would have.
    ``counters`` None: the link counts no octets.
    """

    link_up: bool = True
    mau_type: int = MAU_100BASE_TX_FULL_DUPLEX
    counters: PortCounters | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """One channel error of a port; ``detail`` in words, for the log."""

    error_type: int
    ext_error_type: int
    detail: str = ""

    @property
    def key(self) -> tuple[int, int]:
        return self.error_type, self.ext_error_type


@dataclass(frozen=True, slots=True)
class CheckFailed:
    """A port is not as the controller expects: a diagnosis appears there."""

    slot: int
    subslot: int
    error_type: int
    ext_error_type: int
    detail: str = ""


@dataclass(frozen=True, slots=True)
class CheckPassed:
    """A failed check passes again, or is no longer requested: the diagnosis disappears."""

    slot: int
    subslot: int
    error_type: int
    ext_error_type: int


#: dot3MauType of fibres among those that PROFINET names (IEC 61158-6-10, coding of the field MAUType).
_FIBER = frozenset({0x0C, 0x0D, 0x11, 0x12, 0x15, 0x16, 0x17, 0x18, 0x19, 0x1A, 0x1F, 0x2E, 0x36})


def media_type_of(mau_type: int) -> MediaType:
    """0 is radio (IEC 61158-6-10, coding of the field MAUType)."""
    if mau_type == 0:
        return MediaType.RADIO
    return MediaType.FIBER if mau_type in _FIBER else MediaType.COPPER


def compare(
    checks: Iterable[Block], port: PortFacts, neighbours: Sequence[Neighbour], *, peers_known: bool = True
) -> tuple[Finding, ...]:
    """The channel errors that hold now; without ``peers_known`` a missing neighbour is not an error yet.

    A port that hears several neighbours passes if one of them is the expected one.
    """
    found: list[Finding] = []
    heard = neighbours if port.link_up else ()
    for check in checks:
        match check:
            case CheckPeers(peers):
                found += _compare_peers(peers, heard, missing=peers_known or not port.link_up)
            case CheckLinkState(_, link):
                found += _compare_link(link, port)
            case CheckMauType(mau_type) if port.link_up and mau_type != port.mau_type:
                detail = f"0x{port.mau_type:04X} where 0x{mau_type:04X} is expected"
                found.append(_impossible(DataTransmission.MAU_TYPE_MISMATCH, detail))
            case CheckMauTypeDifference(mode) if mode & 1:
                found += [
                    _mismatch(RemoteMismatch.PEER_MAU_TYPE, f"{n.station_name} has 0x{n.mau_type:04X}")
                    for n in heard
                    if n.mau_type is not None and n.mau_type != port.mau_type
                ][:1]
    return tuple({finding.key: finding for finding in reversed(found)}.values())[::-1]


def _compare_peers(peers: tuple[ExpectedPeer, ...], heard: Sequence[Neighbour], *, missing: bool) -> list[Finding]:
    if not peers:
        return []
    if not heard:
        return [_mismatch(RemoteMismatch.NO_PEER_DETECTED, "no neighbour is heard")] if missing else []
    stations = [n for n in heard if any(_is_station(n, peer) for peer in peers)]
    if any(_is_port(n, peer) for n in stations for peer in peers if _is_station(n, peer)):
        return []
    found = []
    if not stations:
        found.append(_mismatch(RemoteMismatch.PEER_STATION_NAME, f"{heard[0].station_name} is heard"))
    if not any(_is_port(n, peer) for n in stations or heard for peer in peers):
        found.append(_mismatch(RemoteMismatch.PEER_PORT_NAME, f"{heard[0].port_name} is heard"))
    # several peers, each name somewhere, but no neighbour with both of one peer
    return found or [_mismatch(RemoteMismatch.PEER_PORT_NAME, f"{stations[0].port_name} is heard")]


def _is_station(neighbour: Neighbour, peer: ExpectedPeer) -> bool:
    wanted = peer.station_name.decode("utf-8", "replace").casefold()
    return wanted in {neighbour.station_name.casefold(), neighbour.chassis.text.casefold()}


def _is_port(neighbour: Neighbour, peer: ExpectedPeer) -> bool:
    wanted = peer.port_name.decode("utf-8", "replace").casefold()
    return wanted in {neighbour.port_name.casefold(), neighbour.port_id.text.casefold()}


def _compare_link(link: int, port: PortFacts) -> list[Finding]:
    if link in {LinkStateLink.UP, LinkStateLink.DOWN} and (link == LinkStateLink.UP) != port.link_up:
        return [_impossible(DataTransmission.LINK_STATE_MISMATCH, "link is " + ("up" if port.link_up else "down"))]
    return []


def _mismatch(ext: RemoteMismatch, detail: str) -> Finding:
    return Finding(ChannelErrorType.REMOTE_MISMATCH, ext, detail)


def _impossible(ext: DataTransmission, detail: str) -> Finding:
    return Finding(ChannelErrorType.DATA_TRANSMISSION_IMPOSSIBLE, ext, detail)
