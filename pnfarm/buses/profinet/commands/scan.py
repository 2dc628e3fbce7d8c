"""PROFINET's part of ``pnfarm scan``: devices that answer DCP, and the neighbours that send LLDP."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.commands.asking import ask_stations
from pnfarm.buses.profinet.controller.search import duplicate_names
from pnfarm.buses.search import SearchAnswer
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.dcp.client import DcpClient, IdentifyAnswered
from pnfarm.protocols.profinet.lldp.agent import LldpPort, LocalPort, LocalSystem
from pnfarm.terminal.output import print_line, print_table
from pnfarm.vocabulary.quoting import printable
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, parse_ethernet

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.buses.search import Question
    from pnfarm.protocols.profinet.lldp.agent import Neighbour

__all__ = ["search"]

#: IEC 61158-6-10, coding of DeviceRoleDetails.
_ROLES = ("device", "controller", "multidevice", "supervisor")
#: Most LLDP neighbours that are kept.
_MAXIMUM = 4096


async def search(question: Question) -> SearchAnswer:
    """Devices by DCP (name, type, addresses, ids, role), and neighbours at the wire's other end by LLDP."""
    heard = await ask_stations(question.interface, None, partial(_Search, question))
    with_lldp = question.neighbour_seconds > 0
    neighbours = heard.lldp.neighbours if with_lldp else ()
    found = _join([_answer(event) for event in heard.answers], [_heard(neighbour) for neighbour in neighbours])
    show = partial(_print, found, question.interface, with_lldp=with_lldp)
    return SearchAnswer(found, show, tuple(map(printable, duplicate_names(heard.answers))))


class _Search:
    """The answers to one Identify, and the neighbours that send LLDP until the question's time for them is over."""

    def __init__(self, question: Question, mac: bytes) -> None:
        self.answers: list[IdentifyAnswered] = []
        self.done = False
        # it only listens: its to_send is never called
        self.lldp = LldpPort(LocalSystem(mac), LocalPort(1, mac), maximum=_MAXIMUM)
        # two scans at once must not take each other's answers
        self._dcp = DcpClient(mac, first_xid=time.monotonic_ns() & 0x7FFF_FFFF | 1)
        self._question = question
        self._due_ns = 0

    def start(self, now: int) -> None:
        # LLDP cannot be requested: it is sent every 5 s
        self._due_ns = now + round(self._question.neighbour_seconds * 1e9)
        self._dcp.identify(now=now, window_ns=round(self._question.seconds * 1e9))

    def receive(self, data: bytes, now: int) -> None:
        try:
            frame = parse_ethernet(data)
            if frame.ethertype == ETHERTYPE_LLDP:
                self.lldp.receive(frame, now)
            else:
                self._dcp.receive(frame, now)
        except DecodeError:
            return  # a malformed frame of another station

    def to_send(self, now: int) -> list[bytes]:
        return self._dcp.to_send(now)

    def next_deadline(self) -> int:
        return self._dcp.next_deadline() or self._due_ns

    def handle_timeout(self, now: int) -> None:
        self._dcp.handle_timeout(now)
        # Hello of devices that start just now is left out: they answer Identify as well
        events = self._dcp.events()
        self.answers += [event for event in events if isinstance(event, IdentifyAnswered)]
        self.done = self._dcp.next_deadline() is None and now >= self._due_ns


def _print(found: list[dict[str, Any]], interface: str, *, with_lldp: bool) -> None:
    columns = ("NAME", "TYPE", "MAC", "IP", "VENDOR", "DEVICE", "~ROLE")
    rows = [
        (
            printable(device["name"] or "-"),
            printable(device["type"] or "-"),
            device["mac"],
            device["ip"] or "-",
            _hex(device["vendor_id"]),
            _hex(device["device_id"]),
            " ".join(device["roles"]) or "-",
        )
        for device in found
        if device["answers_dcp"]
    ]
    if rows:
        print_table(columns, rows)
    else:
        print_line(f"{interface}: no device answers to DCP")
    if not with_lldp:
        return
    heard = [(device, neighbour) for device in found for neighbour in device["neighbours"]]
    print_line("")
    print_line(f"{interface}: {len(heard)} heard by LLDP")
    for place, (device, neighbour) in enumerate(heard):
        branch = "└─" if place == len(heard) - 1 else "├─"
        about = [neighbour["mac"], neighbour["ip"], device["type"] or neighbour["system_description"]]
        more = "  ".join(word for word in about if word)
        print_line(printable(f"{branch} {neighbour['station']} {neighbour['port']}  {more}"))


def _join(devices: list[dict[str, Any]], heard: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each device with its LLDP data, then the stations that send LLDP and do not answer DCP, such as a switch."""
    by_mac = {device["mac"]: device for device in devices}
    for neighbour in heard:
        known = by_mac.get(neighbour["chassis_mac"] or "") or by_mac.get(neighbour["mac"])
        if known is None:
            known = _device(neighbour["mac"], neighbour["station"], neighbour["ip"])
            devices.append(known)
            by_mac[neighbour["chassis_mac"] or neighbour["mac"]] = known
        known["neighbours"].append(neighbour)
    return sorted(devices, key=lambda device: (not device["answers_dcp"], device["name"] or "", device["mac"]))


def _device(mac: str, name: str | None, ip: str | None) -> dict[str, Any]:
    """A station that did not answer DCP."""
    nothing = dict.fromkeys(("mask", "gateway", "vendor_id", "device_id", "role"))
    return {
        "name": name,
        "type": None,
        "mac": mac,
        "ip": ip,
        **nothing,
        "roles": [],
        "answers_dcp": False,
        "neighbours": [],
    }


def _answer(event: IdentifyAnswered) -> dict[str, Any]:
    info = event.info
    role = info.role or 0
    return {
        "name": info.name,
        "type": info.station_type,
        "mac": event.mac.hex(":"),
        "ip": _address(info.ip),
        "mask": _address(info.mask),
        "gateway": _address(info.gateway),
        "ip_conflict": info.ip_conflict,
        "vendor_id": info.vendor_id,
        "device_id": info.device_id,
        "role": info.role,
        "roles": [word for bit, word in enumerate(_ROLES) if role >> bit & 1],
        "answers_dcp": True,
        "neighbours": [],
    }


def _heard(neighbour: Neighbour) -> dict[str, Any]:
    return {
        "station": neighbour.station_name,
        "port": neighbour.port_name,
        "chassis": neighbour.chassis.text,
        "port_id": neighbour.port_id.text,
        "system_name": neighbour.system_name or None,
        "system_description": neighbour.system_description or None,
        "mac": neighbour.mac.hex(":"),
        "chassis_mac": neighbour.chassis_mac.hex(":") if neighbour.chassis_mac is not None else None,
        "ip": str(neighbour.ip) if neighbour.ip is not None else None,
        "time_to_live_seconds": neighbour.time_to_live,
    }


def _address(value: IPv4Address | None) -> str | None:
    """DCP reports no address as 0.0.0.0."""
    return str(value) if value is not None and int(value) else None


def _hex(value: int | None) -> str:
    return "-" if value is None else f"0x{value:04X}"
