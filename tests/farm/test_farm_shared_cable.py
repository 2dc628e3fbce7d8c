"""A group-addressed frame that is handed only to the drives that it concerns: the answers are those of the full way."""

from __future__ import annotations

from ipaddress import IPv4Address, IPv4Interface

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.wire.dcp.blocks import (
    AliasBlock,
    AllSelectorBlock,
    DeviceIdBlock,
    DeviceInstanceBlock,
    DeviceRoleBlock,
    IpParameterBlock,
    NameBlock,
    StationTypeBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_REQUEST,
    DcpPdu,
    emit_dcp,
    frame_id_of,
)
from pnfarm.testing import Line

FARM = """
farm: cable
link: {kind: memory}
drives:
  - {name: 'axis-{n:02}', count: 4, model: akd-profinet, ip: 10.77.0.11/23}
  - {name: 'turn-{n:02}', count: 2, model: hiwin-e1, ip: 10.77.0.31/23}
  - {name: 'bare-{n:02}', count: 1, model: akd-profinet}
"""
IDENTIFY, HELLO, BROADCAST = bytes.fromhex("010ecf000000"), bytes.fromhex("010ecf000001"), b"\xff" * 6
TOOL, OTHER = bytes.fromhex("02cc00000001"), bytes.fromhex("02cc00000002")
DRIVES = 7
NAMES = ("axis-01", "axis-02", "turn-01", "bare-01", "press", "")
ADDRESSES = ("10.77.0.11", "10.77.0.12", "10.77.0.31", "10.77.0.77", "0.0.0.0")
MS = 1_000_000


class Cable:
    """A farm whose drives share a cable; with ``short`` only those that a frame concerns get it."""

    def __init__(self, *, short: bool) -> None:
        self.line = Line.from_text(FARM)
        self.line.run(0.1)
        self.core = self.line.core
        self.short = short
        self.handed = 0
        self.sent: list[tuple[int, bytes]] = []
        self.core.link.inner.send = lambda port, frame: self.sent.append((port, bytes(frame)))
        self.now = self.line.now_ns

    def hear(self, frame: bytes) -> None:
        ports = [station.port.index for station in self.core.axes]
        audience = self.core._audience(frame) if self.short else None
        for port in ports if audience is None else audience:
            self.handed += 1
            self.core.receive(port, frame, self.now)

    def do(self, what: str, drive: int, data: object) -> None:
        station = self.core.axes[drive]
        self.now += MS
        match what:
            case "hear":
                self.hear(data)
            case "set":
                pdu = DcpPdu(frame_id_of(SERVICE_SET, TYPE_REQUEST), SERVICE_SET, TYPE_REQUEST, 7, data)
                frame = station.port.mac + TOOL + b"\x88\x92" + emit_dcp(pdu)
                self.core.receive(station.port.index, frame, self.now)
            case "neighbour":
                station.device.dcp.aliases = frozenset(data)
                self.core.settle(station.station, self.now)
            case "power":
                (station.station.power_off if station.powered else station.station.power_on)(self.now)
                self.core.settle(station.station, self.now)
            case "inject":
                fields = {"kind": data, "on": station.configured_name}
                self.core.injections.inject(fields, self.now)
            case "clear":
                self.core.injections.clear(None, self.now)
            case "wait":
                self.now += data * MS
        self.core.service(self.now)

    def discards(self) -> list[dict[str, int]]:
        return [
            {reason: count for reason, count in station.device.discards().items() if count}
            for station in self.core.axes
        ]


blocks = st.one_of(
    st.sampled_from(NAMES).map(NameBlock),
    st.sampled_from(("port-001.switch", "port-002.plc", "")).map(AliasBlock),
    st.builds(DeviceInstanceBlock, st.integers(0, 1), st.integers(0, 2)),
    st.sampled_from((0x0105, 0x0AAA, 1)).map(lambda vendor: DeviceIdBlock(vendor, 1)),
    st.integers(0, 2).map(DeviceRoleBlock),
    st.sampled_from(("AKD", "E1")).map(StationTypeBlock),
    st.just(AllSelectorBlock()),
)


@st.composite
def dcp_frames(draw):
    service = draw(st.sampled_from((SERVICE_IDENTIFY, SERVICE_IDENTIFY, SERVICE_IDENTIFY, SERVICE_HELLO)))
    wanted = tuple(draw(st.lists(blocks, max_size=3)))
    delay = draw(st.sampled_from((0, 1, 3)))
    pdu = DcpPdu(frame_id_of(service, TYPE_REQUEST), service, TYPE_REQUEST, 9, wanted, response_delay_factor=delay)
    to = HELLO if service == SERVICE_HELLO else IDENTIFY
    return to + draw(st.sampled_from((TOOL, OTHER))) + b"\x88\x92" + emit_dcp(pdu).ljust(46, b"\0")


@st.composite
def arp_frames(draw):
    sender, target = (IPv4Address(draw(st.sampled_from(ADDRESSES))).packed for _ in range(2))
    head = bytes.fromhex("0001080006040001") if draw(st.booleans()) else bytes.fromhex("0001080006040002")
    source = draw(st.sampled_from((TOOL, OTHER)))
    return (BROADCAST + source + b"\x08\x06" + head + source + sender + bytes(6) + target).ljust(60, b"\0")


@st.composite
def damaged(draw):
    frame = bytearray(draw(st.one_of(dcp_frames(), arp_frames())))
    for place in draw(st.lists(st.integers(12, len(frame) - 1), max_size=4)):
        frame[place] = draw(st.integers(0, 255))
    return bytes(frame[: draw(st.integers(14, len(frame)))])


addresses = st.sampled_from(ADDRESSES).map(
    lambda ip: IpParameterBlock(IPv4Address(ip), IPv4Interface("0.0.0.0/23").netmask, IPv4Address(0), 1)
)
steps = st.one_of(
    st.tuples(st.just("hear"), st.just(0), st.one_of(dcp_frames(), arp_frames(), damaged())),
    st.tuples(st.just("hear"), st.just(0), dcp_frames()),
    st.tuples(
        st.just("set"),
        st.integers(0, DRIVES - 1),
        st.tuples(st.one_of(addresses, st.sampled_from(NAMES).map(lambda name: NameBlock(name, 1)))),
    ),
    st.tuples(st.just("neighbour"), st.integers(0, DRIVES - 1), st.sampled_from(((), ("port-001.switch",)))),
    st.tuples(st.just("power"), st.integers(0, DRIVES - 1), st.none()),
    st.tuples(st.just("inject"), st.integers(0, DRIVES - 1), st.sampled_from(("dcp-silence", "link-down"))),
    st.tuples(st.just("clear"), st.just(0), st.none()),
    st.tuples(st.just("wait"), st.just(0), st.sampled_from((5, 400, 4000))),
)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(steps, min_size=4, max_size=40))
def test_who_is_left_out_would_not_have_answered(script):
    full, short = Cable(short=False), Cable(short=True)
    for step in script:
        full.do(*step)
        short.do(*step)
        assert sorted(short.sent) == sorted(full.sent)
    assert short.handed <= full.handed


def frame(*wanted, source=TOOL):
    frame_id = frame_id_of(SERVICE_IDENTIFY, TYPE_REQUEST)
    pdu = DcpPdu(frame_id, SERVICE_IDENTIFY, TYPE_REQUEST, 9, wanted, response_delay_factor=1)
    return IDENTIFY + source + b"\x88\x92" + emit_dcp(pdu)


def arp(target):
    head = bytes.fromhex("0001080006040001")
    packet = head + TOOL + bytes([10, 77, 0, 1]) + bytes(6) + IPv4Address(target).packed
    return BROADCAST + TOOL + b"\x08\x06" + packet


def test_one_name_is_handed_to_one_drive_and_counts_for_the_others():
    cable, full, before = Cable(short=True), Cable(short=False), Cable(short=True)
    for one in (cable, full):
        one.do("hear", 0, frame(NameBlock("axis-02")))
        one.do("hear", 0, arp("10.77.0.12"))
    assert cable.handed == 2
    assert {port for port, _ in cable.sent} == {cable.core.axes[1].port.index}
    assert cable.discards()[1] == full.discards()[1]
    for reason in ("identify-for-another", "arp-for-another"):
        counts = [[one.core.axes[n].device.discards().get(reason, 0) for n in (0, 2, 6)] for one in (before, cable)]
        assert [after - first for first, after in zip(*counts, strict=True)] == [1, 1, 1]


def test_two_drives_of_one_name_both_answer():
    cable = Cable(short=True)
    cable.do("set", 2, (NameBlock("axis-02", 1),))
    cable.sent.clear()
    cable.do("hear", 0, frame(NameBlock("axis-02")))
    assert {port for port, _ in cable.sent} == {cable.core.axes[1].port.index, cable.core.axes[2].port.index}


def test_an_alias_and_an_instance_are_looked_up_and_all_asks_all():
    cable = Cable(short=True)
    cable.do("neighbour", 5, ("port-001.switch",))
    cable.do("hear", 0, frame(AliasBlock("port-001.switch")))
    assert (cable.handed, {port for port, _ in cable.sent}) == (1, {cable.core.axes[5].port.index})
    cable.do("hear", 0, frame(DeviceInstanceBlock(0, 7)))
    assert cable.handed == 1
    cable.do("hear", 0, frame(AllSelectorBlock()))
    assert cable.handed == 1 + DRIVES


def test_a_drive_with_an_injection_sees_each_frame():
    cable = Cable(short=True)
    cable.do("inject", 3, "dcp-silence")
    before = cable.handed
    cable.do("hear", 0, frame(NameBlock("axis-01")))
    assert cable.handed == before + 2


def test_what_passes_by_while_a_drive_is_off_does_not_count_there():
    cable = Cable(short=True)
    before = cable.discards()[0]
    cable.do("power", 0, None)
    cable.do("hear", 0, frame(NameBlock("axis-02")))
    cable.do("power", 0, None)
    assert cable.discards()[0].get("identify-for-another", 0) == before.get("identify-for-another", 0)
    cable.do("hear", 0, frame(NameBlock("axis-02")))
    assert cable.discards()[0]["identify-for-another"] == before.get("identify-for-another", 0) + 1
