"""mac-change: the drive is another station by its MAC address, and the same one by name, until it ends."""

import asyncio

import pytest
from fault_line import FaultLine
from storm import left_behind

from pnfarm.errors import EnvironmentError_
from pnfarm.faults.effects.addresses import Addresses
from pnfarm.faults.errors import InjectionError
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, ETHERTYPE_PROFINET
from pnfarm.wire.mac import parse_mac

OTHER = "02:aa:00:00:00:07"


class Ear:
    """Hears what the first drive sends: the source addresses by EtherType, and LLDP chassis ids."""

    def __init__(self, line: FaultLine) -> None:
        self.sources: dict[int, set[bytes]] = {}
        self.frames: list[bytes] = []
        line.farm.link.listen(line.farm.axes[0].port.index, self._hear)

    def _hear(self, direction, frame, now) -> None:
        if direction == "out":
            self.sources.setdefault(int.from_bytes(frame[12:14], "big"), set()).add(frame[6:12])
            self.frames.append(frame)

    def forget(self) -> None:
        self.sources.clear()
        self.frames.clear()


def test_a_changed_drive_loses_its_connection_and_is_found_by_its_name_at_the_other_address_until_it_ends(line):
    own = line.farm.axes[0].port.mac
    ear = Ear(line)
    fault = line.add("mac-change", params={"mac": OTHER}, as_="swap")
    assert line.until(lambda: not line.plc.all_connected)
    line.connect(20.0)
    assert line.session().mac == parse_mac(OTHER)
    line.enable(10.0)
    ear.forget()
    line.run(12.0)
    assert ear.sources[ETHERTYPE_LLDP] == {parse_mac(OTHER)}
    assert all(parse_mac(OTHER) in frame[14:] for frame in ear.frames if frame[12:14] == b"\x88\xcc")
    seen = fault.evidence()
    assert (seen.checks, seen.activations, seen.confirmed) == (1, 1, True)
    assert line.farm.columns.image[0].mac == int.from_bytes(parse_mac(OTHER), "big")

    line.clear("swap")
    ear.forget()
    assert line.until(lambda: not line.plc.all_connected)
    line.connect(20.0)
    assert line.session().mac == own
    line.run(12.0)
    assert ear.sources[ETHERTYPE_PROFINET] == ear.sources[ETHERTYPE_LLDP] == {own}
    line.enable(10.0)
    line.farm.link.unlisten(line.farm.axes[0].port.index, ear._hear)
    assert left_behind(line) == {}


def test_another_seed_gives_another_locally_administered_address_and_the_same_seed_the_same(line):
    macs = []
    for seed in (1, 1, 2):
        line.add("mac-change", seed=seed, as_="swap")
        macs.append(line.farm.axes[0].port.mac)
        line.clear("swap")
    assert macs[0] == macs[1] != macs[2]
    assert all(mac[0] & 3 == 2 for mac in macs)


def test_two_changes_of_one_drive_end_in_either_order_and_the_latest_counts():
    for first, last in (("one", "two"), ("two", "one")):
        line = FaultLine()
        own = line.farm.axes[0].port.mac
        line.add("mac-change", params={"mac": OTHER}, as_="one")
        line.add("mac-change", params={"mac": "02:aa:00:00:00:08"}, as_="two")
        assert line.farm.axes[0].port.mac == parse_mac("02:aa:00:00:00:08")
        line.clear(first)
        assert line.farm.axes[0].port.mac == parse_mac("02:aa:00:00:00:08" if last == "two" else OTHER)
        line.clear(last)
        assert line.farm.axes[0].port.mac == own
        line.connect(20.0)
        assert left_behind(line) == {}


def test_a_change_while_a_power_cycle_keeps_the_drive_off_leaves_it_off_and_holds_when_it_boots(line):
    line.add("power-cycle", params={"off": "2s"})
    line.add("mac-change", params={"mac": OTHER}, **{"for": "5s"})
    line.run(1.0)
    assert not line.farm.axes[0].powered
    line.run(3.0)
    assert line.farm.axes[0].powered
    assert line.session().mac == parse_mac(OTHER)
    line.run(2.0)
    line.connect(20.0)
    assert left_behind(line) == {}


def test_an_address_that_is_in_use_or_an_interface_that_is_not_the_farms_is_refused_with_the_reason():
    line = FaultLine(2)
    for of, what in ((0, "axis-01 itself"), (1, "axis-02")):
        mac = line.farm.axes[of].port.mac.hex(":")
        with pytest.raises(InjectionError, match=rf"params\.mac: {mac} is the address of {what}"):
            line.add("mac-change", on="axis-01", params={"mac": mac})
    line.add("mac-change", on="axis-02", params={"mac": OTHER})
    with pytest.raises(InjectionError, match="is the address of axis-02"):
        line.add("mac-change", on="axis-01", params={"mac": OTHER})
    line.farm_link.kind = "interface"
    with pytest.raises(InjectionError, match="the interface of axis-01 is not the farm's, so its MAC address stays"):
        line.add("mac-change", on="axis-01")
    assert [found.spec.on for found in line.faults.list()] == [["axis-02"]]


def test_an_address_that_another_drive_got_before_the_fault_begins_is_refused_then():
    line = FaultLine(2)
    late = line.add("mac-change", on="all", params={"mac": OTHER}, after="1s")
    line.run(1.1)
    assert [axis.port.mac == parse_mac(OTHER) for axis in line.farm.axes] == [True, False]
    assert [(run.state, run.reason) for run in late.runs.values()] == [
        ("active", ""),
        ("ended", f"fault.params.mac: {OTHER} is the address of axis-01; allowed: that of no drive"),
    ]


def test_an_address_comes_again_at_a_rate(line):
    swap = line.add("mac-change", params={"mac": OTHER}, rate="1/s", times=3, **{"for": "200ms"})
    assert line.until(lambda: swap.state == "ended", 60.0)
    assert swap.evidence().activations == 3


class Slow:
    """A link that refuses what it is told to, and takes a turn of the loop for the rest."""

    kind = "veth"

    def __init__(self) -> None:
        self.mac = b"own..."
        self.refused: set[bytes] = set()
        self.asked: list[bytes] = []

    async def set_mac(self, port: int, mac: bytes) -> None:
        await asyncio.sleep(0)
        self.asked.append(mac)
        if mac in self.refused:
            raise EnvironmentError_("no")
        self.mac = mac


@pytest.mark.asyncio
async def test_on_a_real_link_the_drive_is_off_until_the_link_has_the_address_also_when_it_ends_meanwhile():
    link, told, life = Slow(), [], []
    addresses = Addresses(link, lambda drive, reason: told.append((drive, reason)))
    addresses.add(1, "axis-01", b"own...", lambda now: life.append("off"), lambda mac, now: life.append(mac))
    addresses.change(1, b"other.", 0)
    assert life == ["off"]
    assert addresses.next_deadline() is not None
    addresses.restore(1, b"other.", 0)
    for now in range(0, 100_000_000, 10_000_000):
        await asyncio.sleep(0)
        addresses.handle_timeout(now)
    assert life == ["off", b"own..."]
    assert link.mac == b"own..."
    assert (addresses.next_deadline(), addresses.in_force(1), told) == (None, [], [])


@pytest.mark.asyncio
async def test_an_address_that_the_link_refuses_is_reported_and_one_that_it_cannot_restore_is_tried_again(monkeypatch):
    monkeypatch.setattr("pnfarm.faults.effects.addresses.AGAIN_SECONDS", 0)
    link, told, life = Slow(), [], []
    addresses = Addresses(link, lambda drive, reason: told.append((drive, reason)))
    addresses.add(1, "axis-01", b"own...", lambda now: life.append("off"), lambda mac, now: life.append(mac))

    async def turns(now: int) -> None:
        for _ in range(10):
            await asyncio.sleep(0)
        addresses.handle_timeout(now)

    link.refused = {b"other."}
    addresses.change(1, b"other.", 0)
    await turns(10_000_000)
    assert addresses.failure(1) == "no"
    addresses.restore(1, b"other.", 20_000_000)
    await turns(30_000_000)
    assert life == ["off", b"own..."]
    link.refused = set()
    addresses.change(1, b"other.", 40_000_000)
    await turns(50_000_000)
    assert life[2:] == ["off", b"other."]
    link.refused = {b"own..."}
    addresses.restore(1, b"other.", 60_000_000)
    await turns(70_000_000)
    assert told == [("axis-01", "no")]
    assert life[4:] == ["off"]
    link.refused = set()
    await turns(80_000_000)
    assert life[5:] == [b"own..."]
    assert addresses.in_force(1) == []
