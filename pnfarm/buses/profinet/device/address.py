"""Name and address of one drive: DCP and ARP on one side, non-volatile memory and the event log on the other.

What DCP sets goes to the IP host and into the memory; an address conflict that ARP detects goes to DCP, which reports
it.  Every address is probed before it is announced, whether from the memory, the farm file or DCP.
"""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.device import events
from pnfarm.errors import DecodeError
from pnfarm.protocols.ip.host import AddressConflict, AddressRefused, AddressSettled, IpHost
from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import (
    NO_DNS,
    DcpIdentity,
    Dns,
    HelloMode,
    HelloSettings,
    IpSet,
    NameSet,
    SignalBegan,
    SignalEnded,
    router_of,
)
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.records.fsu import parse_fsu_data_adjust
from pnfarm.station import events as happened
from pnfarm.station.events import StartUpPhase

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.protocols.ip.host import IpEvent
    from pnfarm.protocols.profinet.dcp.rules import DcpDeviceEvent
    from pnfarm.station.event import Event

__all__ = ["StationAddress"]

_MS = 1_000_000
#: Most Hellos in a row (coding of FSHelloRetry: 1 to 15).
_MOST_HELLOS = 15


class StationAddress:
    """``kept`` is the memory as it was at power-on; ``keep`` writes one key through, ``note`` an event.

    ``config``: its address and name apply while the memory has none.
    """

    def __init__(
        self,
        mac: bytes,
        identity: DcpIdentity,
        config: ProfinetDriveConfig | ProfinetDeviceConfig,
        kept: Mapping[str, Any],
        *,
        keep: Callable[[int, str, Any], None],
        note: Callable[[int, Event], None],
    ) -> None:
        self._keep, self._note = keep, note
        address, gateway, dns = config.ip, config.gateway, NO_DNS
        if "ip" in kept:
            address = IPv4Interface(kept["ip"]) if kept["ip"] else None
            gateway = IPv4Address(kept["gateway"]) if kept.get("gateway") else None
            dns = _dns(kept.get("dns"))
        name = kept.get("name", config.name)
        self.dcp = DcpDevice(mac, identity, name=name, address=address, gateway=gateway, dns=dns)
        self.dcp.hello_settings = _hello(kept.get("hello"), on=config.hello)
        self.ip = IpHost(mac)
        #: MAC address of another user of the address, or None.
        self.conflict_mac: bytes | None = None
        self.ip.own_address(address, router_of(address, gateway))
        self._own(address)

    def link_up(self, now: int) -> None:
        """Probe for another user of the address before announcing it; it is used meanwhile."""
        if self.ip.wanted is not None:
            self.ip.claim_address(self.ip.wanted, self.ip.gateway, now)
        self.dcp.link_up(now)

    def set_address(self, address: IPv4Interface | None, gateway: IPv4Address | None, now: int) -> None:
        """Use an address, or none; it is probed on the segment first."""
        if address is None:
            self.ip.set_address(address, gateway)
        else:
            self.ip.claim_address(address, gateway, now)
        self._own(address)

    def _own(self, address: IPv4Interface | None) -> None:
        self._no_conflict()
        #: The address as in an ARP packet, empty for none: compared for every broadcast.
        self.own_ip = address.ip.packed if address is not None else b""

    def _no_conflict(self) -> None:
        self.dcp.ip_conflict, self.dcp.ip_in_use, self.conflict_mac = False, True, None

    # -- DCP ---------------------------------------------------------------------------------------------------------

    def take_dcp(self, event: DcpDeviceEvent, now: int) -> None:
        """Apply a DCP event to address, memory and log; the station does the rest."""
        match event:
            case NameSet(name, permanent):
                self._keep(now, "name", name if permanent else "")
                self._note(now, events.NameSet(name, permanent))
            case IpSet(interface, gateway, permanent, dns):
                if (interface, gateway) != (self.ip.wanted, self.ip.gateway):
                    self.set_address(interface, gateway, now)
                self._keep(now, "ip", str(interface) if interface and permanent else "")
                # as it was set, not as it is used: tools compare it
                self._keep(now, "gateway", str(self.dcp.gateway) if self.dcp.gateway and permanent else "")
                self._keep(now, "dns", [str(ip) for ip in dns] if permanent and dns != NO_DNS else None)
                self._note(now, events.AddressSet(interface, permanent))
                self._note(now, StartUpPhase("address"))
            case SignalBegan():
                self._note(now, events.SignalBegan())
            case SignalEnded():
                self._note(now, events.SignalEnded())
            case _:
                pass

    def record_written(self, index: int, data: bytes, now: int) -> None:
        """A record of the interface was accepted: that of fast start-up decides whether Hello is sent from now on."""
        if index != Index.INTERFACE_FSU_DATA_ADJUST:
            return
        try:
            hello = parse_fsu_data_adjust(data).hello
        except DecodeError as exc:
            self._note(now, events.FastStartUpNotUnderstood(exc.reason))
            return
        if hello is not None:
            value = [hello.mode, hello.interval_ms, hello.retry, hello.delay_ms]
            self.dcp.hello_settings = _hello(value, on=False)
            self._keep(now, "hello", value)
            self._note(now, events.HelloSet(self.dcp.hello_settings.mode.name.lower().replace("_", " ")))

    def forget_records(self, *, on: bool) -> None:
        """The interface's records were cleared: Hello is as in the farm file (``on``)."""
        self.dcp.hello_settings = _hello(None, on=on)

    # -- ARP ---------------------------------------------------------------------------------------------------------

    def take_ip(self, event: IpEvent, now: int) -> None:
        """Apply an ARP event."""
        match event:
            case AddressConflict(ip, mac) if mac != self.conflict_mac:
                self.dcp.ip_conflict, self.conflict_mac = True, mac
                self._note(now, happened.AddressConflict(ip, mac))
            case AddressRefused(ip, mac):
                self.dcp.ip_conflict, self.dcp.ip_in_use, self.conflict_mac = True, False, mac
                self._note(now, happened.AddressNotUsed(ip, mac))
            case AddressSettled(ip):
                self._no_conflict()
                self._note(now, happened.AddressConflictOver(ip))
            case _:
                pass


def _dns(kept: list[str] | None) -> Dns:
    if kept is None:
        return NO_DNS
    one, two, three, four = (IPv4Address(text) for text in kept)
    return one, two, three, four


def _hello(kept: list[int] | None, *, on: bool) -> HelloSettings:
    """From FSHelloMode, interval, retry and delay (ms); without them as in the farm file."""
    if kept is None:
        settings = HelloSettings()
        return settings if on else replace(settings, mode=HelloMode.OFF)
    mode, interval_ms, retry, delay_ms = kept
    known = HelloMode(mode) if mode in set(HelloMode) else HelloMode.OFF
    return HelloSettings(known, interval_ms * _MS, min(retry, _MOST_HELLOS), delay_ms * _MS)
