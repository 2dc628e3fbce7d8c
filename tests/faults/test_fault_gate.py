"""Which acyclic frames a fault takes, and the faults of a farm file."""

import asyncio

import pytest
from fault_line import FaultLine
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.farm.config import expand, parse_farm
from pnfarm.farm.fault_targets import add_impairments, attach_faults
from pnfarm.faults.gate import GatedLink, GateRule, every_frame, is_dcp, is_rpc
from pnfarm.links.base import PortSpec
from pnfarm.links.memory import MemoryLink, MemorySwitch

MACS = bytes.fromhex("020000000001020000000002")
TAG = bytes.fromhex("8100c000")


def datagram(source: int, destination: int, *, protocol: int = 17, fragment: int = 0) -> bytes:
    header = bytes([0x45, 0, 0, 40]) + bytes(2) + fragment.to_bytes(2, "big") + bytes([64, protocol]) + bytes(10)
    return MACS + b"\x08\x00" + header + source.to_bytes(2, "big") + destination.to_bytes(2, "big") + bytes(16)


@pytest.mark.parametrize(
    ("frame", "dcp", "rpc"),
    [
        (MACS + bytes.fromhex("8892feff") + bytes(40), True, False),
        (MACS + TAG + bytes.fromhex("8892fefe") + bytes(40), True, False),
        (MACS + bytes.fromhex("8892fe01") + bytes(40), False, False),
        (datagram(49152, 34964), False, True),
        (datagram(161, 50000), False, False),
        (datagram(0, 0, fragment=185), False, True),
        (datagram(34964, 34964, protocol=1), False, False),
        (MACS + bytes.fromhex("0806") + bytes(46), False, False),
        (MACS, False, False),
    ],
)
def test_dcp_and_rpc_are_told_apart_from_all_else(frame, dcp, rpc):
    assert (is_dcp(frame), is_rpc(frame)) == (dcp, rpc)


@given(st.binary(max_size=80))
def test_any_bytes_are_of_some_sort(frame):
    assert not (is_dcp(frame) and is_rpc(frame))
    assert not is_dcp(MACS + b"\x81\x00" + frame) or len(frame) >= 6


def test_a_rule_counts_both_ways_together_and_rests_at_its_count():
    told = []
    rule = GateRule(("out", "in"), every_frame, count=3, lost=lambda: told.append(1))
    assert [rule.loses(way, b"", now) for now, way in enumerate(("out", "in", "out", "in"), 1)] == [
        True,
        True,
        True,
        False,
    ]
    assert rule.exhausted
    assert rule.evidence("out").activations == 2
    assert (rule.evidence().first_ns, rule.evidence().last_ns) == (1, 3)
    assert len(told) == 3


def test_a_rule_rests_at_its_end_and_when_its_count_was_used_up_elsewhere():
    assert not GateRule(("out",), every_frame, stop_ns=100).loses("out", b"", 100)
    spent = [1]
    rule = GateRule(("out",), every_frame, count=2, spent=lambda: spent[0])
    assert rule.loses("out", b"", 1)
    assert not rule.loses("out", b"", 2)


def test_a_gated_link_is_a_link_and_loses_what_its_rules_say():
    switch = MemorySwitch()
    now = 7
    near, far = GatedLink(MemoryLink(switch, lambda: now), lambda: now), MemoryLink(switch, lambda: now)
    (mine,) = asyncio.run(near.open([PortSpec("a", MACS[6:])]))
    (theirs,) = asyncio.run(far.open([PortSpec("b", MACS[:6])]))
    got: list[tuple[str, bytes]] = []
    near.set_receiver(lambda _port, frame, _now: got.append(("near", frame)))
    far.set_receiver(lambda _port, frame, _now: got.append(("far", frame)))
    there, back = MACS + b"\x08\x06there", MACS[6:] + MACS[:6] + b"\x08\x06back"

    def exchange():
        got.clear()
        near.send(mine.index, there)
        far.send(theirs.index, back)
        switch.deliver(now)
        return [name for name, _ in got]

    assert exchange() == ["far", "near"]
    deaf, mute = GateRule(("in",)), GateRule(("out",))
    near.add(mine.index, deaf)
    assert exchange() == ["far"]
    near.add(mine.index, mute)
    assert exchange() == []
    near.remove(mine.index, deaf)
    assert exchange() == ["near"]
    near.remove(mine.index, mute)
    assert exchange() == ["far", "near"]
    assert near.kind == "memory"
    assert near.counters.sent == 3
    asyncio.run(near.set_carrier(mine.index, False))
    assert exchange() == []
    asyncio.run(near.set_carrier(mine.index, True))
    asyncio.run(near.set_mac(mine.index, b"\x02" * 6))
    assert exchange() == ["far"]
    asyncio.run(near.close())


FILE = """
farm: impaired
link: {kind: memory}
drives:
  - name: axis-{n:02}
    count: 3
    model: akd-profinet
    ip: 10.77.0.11/24
    impair:
      - {kind: loss, probability: 0.1, seed: 4, after: 2s}
      - {kind: undervoltage, on: [axis-02, model:akd-*], for: 1.5s}
  - name: press
    model: akd-profinet
    ip: 10.77.0.21/24
    impair:
      - {kind: WHAT, on: WHOM}
"""


def impaired(what: str, whom: str):
    line = FaultLine(4, controller=False)
    drives = expand(parse_farm(FILE.replace("WHAT", what).replace("WHOM", whom)))
    line.farm.listeners.clear()
    for station, drive in zip(line.farm.stations, drives, strict=True):
        station.configured_name = drive.name
    manager = attach_faults(line.farm, line.world.clock)
    add_impairments(manager, drives, line.world.now)
    return manager


def test_the_faults_of_a_farm_file_are_in_force_on_the_drives_of_their_group():
    manager = impaired("silence", "press")
    loss, low, silence = manager.list()
    assert loss.drives == low.drives == ("axis-01", "axis-02", "axis-03")
    assert silence.drives == ("press",)
    assert loss.state == "waiting"
    assert loss.spec.as_dict()["after"] == "2s"
    assert low.spec.as_dict()["for"] == "1.5s"
    assert silence.state == "active"


@pytest.mark.parametrize(
    ("what", "whom", "told"),
    [
        (
            "sielnce",
            "press",
            "impair[0] of drives press to press: fault.kind: 'sielnce' is no kind of fault, did you mean",
        ),
        ("silence", "axis-01", "impair[0] of drives press to press: `on` means none of them"),
        ("drive-fault", "all", "fault.params.fault: is missing"),
    ],
)
def test_a_wrong_fault_of_a_farm_file_is_told_with_its_place(what, whom, told):
    with pytest.raises(ConfigError) as caught:
        impaired(what, whom)
    assert told in str(caught.value)
