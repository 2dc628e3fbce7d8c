"""A drive's ports: joins its LLDP agent and its physical device (PDev).

The cable is connected to the first port of the drive's interface; a model's further ports have no link.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.events import NeighbourEvent, NeighbourLost, PortCheckFailed, PortCheckPassed
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.lldp.agent import (
    LldpPort,
    LocalPort,
    LocalSystem,
    NeighbourAppeared,
    NeighbourChanged,
    NeighbourGone,
    spread_phase,
)
from pnfarm.protocols.profinet.records.pdev import InterfaceFacts, PhysicalDevice
from pnfarm.protocols.profinet.records.pdev_checks import CheckFailed, PortFacts
from pnfarm.protocols.profinet.wire.records.diagnosis import Maintenance, Usi

if TYPE_CHECKING:
    from collections import Counter
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.protocols.profinet.description import DeviceDescription
    from pnfarm.protocols.profinet.lldp.agent import Neighbour
    from pnfarm.protocols.profinet.records.pdev_checks import CheckPassed
    from pnfarm.protocols.profinet.wire.lldp.pdu import Lldpdu
    from pnfarm.station.event import Event

__all__ = ["StationNeighbours", "port_diagnosis", "port_numbers", "system_identification"]

_FIRST_PORT = 0x8001
#: Subslots of the first interface and its ports (IEC 61158-6-10, coding of SubslotNumber).
_INTERFACE = 0x8000
_PORTS = range(_FIRST_PORT, 0x8100)


def system_identification(description: DeviceDescription) -> str:
    """The device's identity in fields of fixed width (IEC 61158-6-10, LLDP: SystemIdentification)."""
    im0 = description.im0
    prefix, *numbers = im0.software_revision
    version = f"{prefix}{numbers[0]:3}{numbers[1]:3}{numbers[2]:3}"
    return (
        f"{description.station_type:<25} {im0.order_id:<20} {im0.serial_number:<16} {im0.hardware_revision:5} {version}"
    )


def port_numbers(description: DeviceDescription) -> list[int]:
    """The port numbers of a station: port 1 if its description has none."""
    return sorted(s.subslot - _INTERFACE for s in description.dap.submodules if s.subslot in _PORTS) or [1]


class StationNeighbours:
    """``index`` spreads the drives of a farm; without ``enabled`` the drive neither sends nor receives LLDP.

    The agent sends what :meth:`update` gave it; what the controller wrote into the PDev records takes effect in
    :meth:`pump`.
    """

    def __init__(self, mac: bytes, index: int, description: DeviceDescription, *, enabled: bool = True) -> None:
        # the management address belongs to the interface, which is numbered after the ports
        interface = port_numbers(description)[-1] + 1
        system = LocalSystem(mac, description=system_identification(description), interface_number=interface)
        name = next((f"port {s.subslot & 0xFF}" for s in description.dap.submodules if s.subslot == _FIRST_PORT), "")
        self.lldp = LldpPort(system, LocalPort(1, mac, name), phase_ns=spread_phase(index))
        self._facts = InterfaceFacts("", mac)
        self._link_up = True
        self._link_changed = False
        self.enabled = enabled
        self.pdev = PhysicalDevice(description.dap.submodules, lambda: self._facts, self._port, self._neighbours_at)
        self._checked: list[CheckFailed | CheckPassed] = []
        #: Neighbours that came, that went, and those among them that aged out; when the last of all changes was.
        self.came = self.went = self.aged_out = 0
        self.changed_ns = 0

    # -- calls of the physical device --------------------------------------------------------------------------------

    def _port(self, subslot: int) -> PortFacts:
        return PortFacts(link_up=self._link_up and subslot == _FIRST_PORT)

    def _neighbours_at(self, subslot: int) -> tuple[Neighbour, ...]:
        return self.lldp.neighbours if subslot == _FIRST_PORT else ()

    # -- calls of the station ----------------------------------------------------------------------------------------

    def update(self, name: str, address: IPv4Interface | None, gateway: IPv4Address | None, now: int) -> None:
        """Set name and address."""
        self._facts = replace(self._facts, name=name, address=address, gateway=gateway)
        ip = address.ip if address is not None and int(address.ip) else None
        self.lldp.update(replace(self.lldp.system, name=name, address=ip), now)

    def set_link(self, *, up: bool) -> None:
        """The cable was pulled or plugged; the next :meth:`pump` handles the consequences."""
        self._link_changed = self._link_changed or up != self._link_up
        self._link_up = up
        if not up:
            self.lldp.link_down()

    def hear(self, frame: bytes, parsed: Lldpdu | str, now: int) -> bool:
        """Take a parsed LLDP frame, or its decode error; whether it changed anything."""
        if not self.enabled:
            return False
        if isinstance(parsed, str):
            self.lldp.dropped[parsed] += 1
            return False
        return self.lldp.hear(parsed, frame[6:12], frame[14:], now)

    @property
    def aliases(self) -> frozenset[str]:
        """Names for DCP's alias filter: a drive is found by the neighbour's port that it is connected to."""
        return frozenset(neighbour.alias for neighbour in self.lldp.neighbours)

    # -- the machine -------------------------------------------------------------------------------------------------

    @property
    def dropped(self) -> Counter[str]:
        return self.lldp.dropped

    def next_deadline(self) -> int | None:
        return earliest(self.lldp, self.pdev)

    def handle_timeout(self, now: int) -> None:
        self.lldp.handle_timeout(now)
        self.pdev.handle_timeout(now)

    def only_sends(self, now: int) -> bool:
        """Whether nothing but a frame of LLDP is due by now, and :meth:`pump` would change nothing."""
        check = self.pdev.next_deadline()
        return not self._link_changed and self.lldp.only_sends(now) and (check is None or now < check)

    def to_send(self, now: int) -> list[bytes]:
        return self.lldp.to_send(now) if self.enabled else []

    def pump(self, now: int) -> list[Event]:
        """Pass events between agent and physical device; returns those for the log."""
        mode = self.pdev.name_mode
        if mode is not self.lldp.system.name_mode:
            self.lldp.update(replace(self.lldp.system, name_mode=mode), now)
        self.lldp.send_frames(_FIRST_PORT not in self.pdev.mute_ports, now)
        happened = self.lldp.events()
        for event in happened:
            self.came += isinstance(event, NeighbourAppeared)
            self.went += isinstance(event, NeighbourGone)
            self.aged_out += isinstance(event, NeighbourGone) and event.reason == "aged-out"
            self.changed_ns = now
        if happened or self._link_changed:
            self._link_changed = False
            self.pdev.evaluate(now)
        notes = [_note(event) for event in happened]
        checked = self.pdev.events()
        self._checked += checked
        return notes + [_check_note(event) for event in checked]

    def checks(self) -> list[CheckFailed | CheckPassed]:
        """Results of the port checks since the last call: diagnoses that appear and disappear."""
        checked, self._checked = self._checked, []
        return checked

    def diagnoses(self) -> list[DiagnosisEntry]:
        """Those of the checks that fail now."""
        return [
            port_diagnosis(CheckFailed(*place, *finding.key))
            for place, findings in self.pdev.findings.items()
            for finding in findings
        ]


def _note(event: NeighbourAppeared | NeighbourChanged | NeighbourGone) -> Event:
    match event:
        case NeighbourAppeared() | NeighbourChanged():
            return NeighbourEvent(event.port, event.neighbour, isinstance(event, NeighbourAppeared))
        case NeighbourGone(reason=reason):
            return NeighbourLost(event.port, event.neighbour, reason)


def _check_note(event: CheckFailed | CheckPassed) -> Event:
    return PortCheckFailed(event) if isinstance(event, CheckFailed) else PortCheckPassed(event)


def port_diagnosis(check: CheckFailed | CheckPassed) -> DiagnosisEntry:
    """The diagnosis of a port that fails its controller's check (ExtChannelDiagnosis of the whole submodule)."""
    return DiagnosisEntry(
        0,
        check.slot,
        check.subslot,
        usi=Usi.EXT_CHANNEL,
        error_type=check.error_type,
        ext_error_type=check.ext_error_type,
        maintenance=Maintenance.DEMANDED,
    )
