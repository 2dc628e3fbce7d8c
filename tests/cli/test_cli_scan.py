"""`pnfarm scan` asks every bus that can be searched; identities on EtherNet/IP, at a farm that runs."""

from __future__ import annotations

import json
import socket
from ipaddress import IPv4Address

import pytest
import typer
from own_interfaces import own_interfaces

from pnfarm.buses import registry
from pnfarm.buses.ethernetip.commands.scan import _take, twice
from pnfarm.buses.profinet.commands import scan as pn_scan
from pnfarm.buses.search import SearchAnswer, SearchBus
from pnfarm.cli.main import main
from pnfarm.protocols.enip.identity_search import IdentitySearch
from pnfarm.protocols.enip.wire.cpf import emit_items
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.identity import IdentityItem
from pnfarm.protocols.profinet.dcp.client import IdentifyAnswered, station_info
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock, StationTypeBlock

FARM = """\
farm: scantest
link: {kind: veth}
api: off
drives:
  - {name: 'cip-{n}', count: 2, model: akd-ethernetip, ip: 10.77.0.11/24}
  - {name: pn-1, model: akd-profinet, ip: 10.77.0.21/24}
"""


class Found(SearchBus):
    """A bus that can be searched."""

    name = "found"
    title = "Found"
    link_kinds = frozenset()
    frame_families = ()

    def __init__(self) -> None:
        self.asked = []

    def channel_rows(self, model):
        return 0

    def fault_kinds(self):
        return ()

    def commands(self):
        return ()

    async def search(self, question):
        self.asked.append(question)
        device = {"name": "one", "type": None, "mac": None, "ip": "10.0.0.1", "vendor_id": 7}
        return SearchAnswer([device], lambda: typer.echo("one at 10.0.0.1"), ("two of them",))


@pytest.fixture
def found():
    made = Found()
    with registry.registered(made):
        yield made


# -- what every bus has of it


def test_a_bus_that_can_be_searched_is_asked_and_shown(found, capsys):
    line = ["scan", "-i", "eth9", "--bus", "found", "--seconds", "3", "--lldp-seconds", "4", "--to", "10.0.0.1"]
    assert main(line) == 0
    assert capsys.readouterr() == ("one at 10.0.0.1\n", "two of them\n")
    (question,) = found.asked
    assert (question.interface, question.seconds, question.neighbour_seconds) == ("eth9", 3.0, 4.0)
    assert question.addresses == (IPv4Address("10.0.0.1"),)
    assert question.chosen


def test_json_says_on_which_bus_a_device_is(found, capsys):
    assert main(["scan", "-i", "eth9", "--bus", "found", "--bus", "found", "--no-lldp", "--format", "json"]) == 0
    (device,) = json.loads(capsys.readouterr().out)
    assert (device["bus"], device["name"], device["vendor_id"]) == ("found", "one", 7)
    assert found.asked[0].neighbour_seconds == 0


def test_a_bus_that_cannot_be_searched_or_is_none_is_refused(capsys):
    assert main(["scan", "-i", "eth9", "--bus", "canopen"]) == 2
    assert "unknown bus 'canopen', allowed are profinet, ethernetip" in capsys.readouterr().err
    assert main(["scan", "-i", "eth9", "--to", "somewhere"]) == 2
    assert "--to 'somewhere' is not an IPv4 address" in capsys.readouterr().err


# -- identities


def answer(serial: int, address: str = "10.0.0.1") -> bytes:
    item = IdentityItem(IPv4Address(address), 452, 16, 1, (1, 13), 0, serial, b"AKD", 3)
    return emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY, emit_items((item,))))


def test_a_device_that_answers_twice_is_listed_once_and_two_at_one_address_are_told():
    search = IdentitySearch()
    here, there = (IPv4Address("10.0.0.1"), 44818), (IPv4Address("10.0.0.2"), 44818)
    for serial, peer in ((1, here), (1, here), (2, there)):
        search.datagram(answer(serial), peer)
    assert len(search.found) == 2
    assert not list(twice(search))
    search.datagram(answer(3), here)
    assert list(twice(search)) == ["two devices answer at 10.0.0.1: one address, two serial numbers"]
    assert len(search.found) == 2


def test_a_serial_number_at_two_addresses_is_told():
    search = IdentitySearch()
    for place in (1, 2):
        search.datagram(answer(9), (IPv4Address(f"10.0.0.{place}"), 44818))
    assert list(twice(search)) == [
        "vendor 452 serial number 0x00000009 appears 2 times: 10.0.0.1, 10.0.0.2",
    ]


def test_what_stations_say_cannot_control_the_terminal(capsys):
    said = (NameBlock("axis\x1b[2J\n-1"), StationTypeBlock("servo\x1b]0;x\x07"))
    neighbour = {"station": "switch\x1b[2J", "port": "port-1\r", "mac": "02:00:00:00:00:02", "ip": None}
    device = pn_scan._answer(IdentifyAnswered(1, bytes(6), station_info(said), said))
    pn_scan._print([device | {"neighbours": [neighbour]}], "eth1", with_lldp=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:2] == ["axis?[2J?-1", "servo?]0;x?"]
    assert lines[-1].startswith("└─ switch?[2J port-1?  02:00:00:00:00:02")


def test_anything_else_that_comes_is_not_a_device():
    search = IdentitySearch()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        wire.bind(("127.0.0.1", 0))
        wire.setblocking(False)
        for data in (b"", bytes(23), answer(1)[:-1], answer(1)):
            peer.sendto(data, wire.getsockname())
        _take(wire, search)
    assert len(search.found) == 1
    assert search.discards == 3


@pytest.fixture
def wire(network, background, tmp_path):
    """A farm that runs, and an interface at its bridge that has no address yet."""
    path = tmp_path / "scan.pnfarm.yml"
    path.write_text(FARM)
    farm = background("--log-format", "console", "up", path)
    farm.wait_for("farm started")
    (bridge,) = [name for name in own_interfaces(network, "scantest") if name.endswith("-br")]
    network("link", "add", "scan0", "type", "veth", "peer", "name", "scan1")
    network("link", "set", "scan1", "master", bridge)
    for end in ("scan0", "scan1"):
        network("link", "set", end, "up")
    yield "scan0"
    network("link", "del", "scan0")
    assert farm.stop() == 0


def test_a_scan_lists_the_devices_of_both_buses(wire, process, network):
    quick = ("--seconds", "1", "--no-lldp")
    without = process("scan", "-i", wire, *quick)
    assert (without.code, without.out.splitlines()[1].split()[0]) == (0, "pn-1")
    assert "interface scan0 has no IPv4 address, so EtherNet/IP devices cannot be asked" in without.err
    named = process("scan", "-i", wire, "--bus", "ethernetip", *quick)
    assert (named.code, named.out) == (4, "")
    network("address", "add", "10.77.0.200/24", "dev", wire)
    devices = json.loads(process("scan", "-i", wire, *quick, "--format", "json").out)
    assert [(device["bus"], device["ip"]) for device in devices] == [
        ("profinet", "10.77.0.21"),
        ("ethernetip", "10.77.0.11"),
        ("ethernetip", "10.77.0.12"),
    ]
    (_, first, _) = devices
    assert (first["vendor_id"], first["device_type"], first["product_code"]) == (452, 16, 1)
    table = process("scan", "-i", wire, "--bus", "ethernetip", "--to", "10.77.0.12", *quick)
    assert [line.split()[:2] for line in table.out.splitlines()[1:]] == [["AKD", "10.77.0.11"], ["AKD", "10.77.0.12"]]


def test_an_interface_that_is_not_there_is_reported_by_each_bus(network, process):
    for bus in ("profinet", "ethernetip"):
        found = process("scan", "--interface", "none0", "--bus", bus)
        assert found.code == 4
        assert "none0" in found.err
