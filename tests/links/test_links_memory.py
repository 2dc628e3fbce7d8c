import asyncio

import pytest

from pnfarm.errors import InternalError
from pnfarm.links import memory
from pnfarm.links.base import Link, PortSpec, unwrap
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.wire.mac import BROADCAST

A, B, C = (bytes([2, 0, 0, 0, 0, n]) for n in (1, 2, 3))
DCP = bytes.fromhex("010ecf000000")


def frame(destination, source, text=b""):
    return destination + source + b"\x88\x92" + text


class Station:
    def __init__(self, switch, mac):
        self.port = switch.attach(mac, self)
        self.heard = []

    def __call__(self, port_index, data, now):
        assert port_index == self.port.index
        self.heard.append((data, now))


@pytest.fixture
def stations():
    switch = MemorySwitch()
    return switch, *(Station(switch, mac) for mac in (A, B, C))


def test_a_unicast_frame_reaches_its_address_and_no_other(stations):
    switch, a, b, c = stations
    switch.send(a.port.index, frame(B, A), 100)
    assert switch.next_deadline() == 100
    assert switch.deliver(100) == 1
    assert b.heard == [(frame(B, A), 100)]
    assert a.heard == c.heard == []
    assert switch.next_deadline() is None


@pytest.mark.parametrize("destination", [BROADCAST, DCP])
def test_a_multicast_reaches_all_others(stations, destination):
    switch, a, b, c = stations
    switch.send(b.port.index, frame(destination, B), 5)
    assert switch.deliver(5) == 2
    assert len(a.heard) == len(c.heard) == 1
    assert b.heard == []


def test_frames_arrive_in_order_and_only_when_their_time_has_come():
    switch = MemorySwitch(latency_ns=1000)
    a, b = Station(switch, A), Station(switch, B)
    for now in (0, 10, 20):
        switch.send(a.port.index, frame(B, A, bytes([now])), now)
    assert switch.deliver(999) == 0
    assert switch.deliver(1010) == 2
    assert switch.deliver(5000) == 1
    assert [(data[-1], now) for data, now in b.heard] == [(0, 1000), (10, 1010), (20, 1020)]


@pytest.mark.parametrize("speakers", [2, 3, 4])
def test_nobody_is_understood_where_several_speak_at_once_on_a_line(speakers):
    switch, heard = MemorySwitch(), []
    ports = [switch.attach(b"", lambda *told: heard.append(told), line="profibus", baud=500_000) for _ in range(4)]
    for port in ports[:speakers]:
        switch.send(port.index, b"\xe5" * port.index, 0)
    switch.deliver(1_000_000)
    assert len(heard) == 3 * speakers
    assert not any(0xE5 in octets for _, octets, _ in heard)


def test_question_and_answer_pass_in_one_instant():
    switch = MemorySwitch()
    a = Station(switch, A)
    echo = switch.attach(B, lambda index, data, now: switch.send(index, frame(data[6:12], B), now))
    switch.send(a.port.index, frame(B, A), 7)
    assert switch.deliver(7) == 2
    assert a.heard == [(frame(A, B), 7)]
    assert echo.name == "memory-2"


def test_stations_that_never_stop_are_noticed(monkeypatch):
    monkeypatch.setattr(memory, "MAX_DELIVERIES", 50)
    switch = MemorySwitch()
    for mac in (A, B):
        switch.attach(mac, lambda index, data, now: switch.send(index, data[6:12] + data[:6], now))
    switch.send(1, B + A, 0)
    with pytest.raises(InternalError, match="50 frames in one instant"):
        switch.deliver(0)


def test_a_pulled_cable_a_changed_and_a_duplicate_address(stations):
    switch, a, b, c = stations
    switch.set_carrier(b.port.index, False)
    switch.send(a.port.index, frame(B, A), 0)
    switch.send(b.port.index, frame(A, B), 0)
    assert switch.deliver(0) == 0
    switch.set_carrier(b.port.index, True)
    switch.set_mac(c.port.index, B)
    switch.send(a.port.index, frame(B, A), 1)
    switch.send(a.port.index, frame(C, A), 1)
    assert switch.deliver(1) == 2
    assert len(b.heard) == len(c.heard) == 1


def test_a_port_may_go_while_frames_are_delivered(stations):
    switch, a, b, c = stations
    switch.set_receiver(b.port.index, lambda *_: switch.detach(c.port.index))
    switch.send(a.port.index, frame(DCP, A), 0)
    assert switch.deliver(0) == 1
    assert c.heard == []
    with pytest.raises(InternalError, match="no port 3"):
        switch.send(c.port.index, frame(A, C), 0)


def test_negative_latency_is_refused():
    with pytest.raises(ValueError, match="before it was sent"):
        MemorySwitch(latency_ns=-1)


def test_a_link_says_whom_a_multicast_concerns(stations):
    switch, a, b, c = stations
    asked = []

    def audience(octets):
        asked.append(octets)
        return [c.port.index] if octets[:6] == DCP else None

    switch.set_audience([b.port.index, c.port.index], audience)
    switch.send(a.port.index, frame(DCP, A), 0)
    switch.send(a.port.index, frame(b"\xff" * 6, A), 0)
    switch.send(a.port.index, frame(B, A), 0)
    assert switch.deliver(0) == 1 + 2 + 1
    assert [len(station.heard) for station in (b, c)] == [2, 2]
    assert asked == [frame(DCP, A), frame(b"\xff" * 6, A)]
    # a port that it does not speak for hears everything; one that is gone, or the sender, nothing
    switch.send(b.port.index, frame(DCP, B), 1)
    switch.send(c.port.index, frame(DCP, C), 1)
    assert switch.deliver(1) == 2 + 1
    switch.detach(c.port.index)
    switch.send(b.port.index, frame(DCP, B), 2)
    assert switch.deliver(2) == 1
    switch.set_audience([b.port.index, c.port.index], None)
    switch.send(a.port.index, frame(DCP, A), 3)
    assert switch.deliver(3) == 1
    assert len(b.heard) == 3


def test_two_links_on_one_switch():
    asyncio.run(_two_links_on_one_switch())


async def _two_links_on_one_switch():
    now = 50
    switch = MemorySwitch()
    farm, plc = MemoryLink(switch, lambda: now), MemoryLink(switch, lambda: now)
    assert isinstance(farm, Link)
    assert unwrap(farm) is farm
    heard = []
    farm.set_receiver(lambda *arrived: heard.append(arrived))
    first, second = await farm.open([PortSpec("axis-01", A), PortSpec("axis-02", B)])
    (controller,) = await plc.open([PortSpec("plc", C)])
    assert (first.name, first.mac, second.index) == ("axis-01", A, 2)
    plc.send(controller.index, frame(DCP, C))
    switch.deliver(50)
    assert heard == [(1, frame(DCP, C), 50), (2, frame(DCP, C), 50)]
    farm.send(controller.index, b"not mine")
    await farm.set_carrier(first.index, False)
    farm.send(first.index, frame(C, A))
    await farm.set_mac(second.index, bytes(6))
    assert farm.counters.as_dict() == {"received": 2, "sent": 0, "dropped_cable-pulled": 1, "dropped_unknown-port": 1}
    with pytest.raises(InternalError, match="already open"):
        await farm.open([])
    await farm.close()
    plc.send(controller.index, frame(DCP, C))
    assert switch.deliver(60) == 0
