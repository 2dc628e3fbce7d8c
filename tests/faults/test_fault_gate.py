"""Which acyclic frames a fault takes, and the faults of a farm file."""

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.controller.line import VirtualLine
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.injections import add_impairments
from pnfarm.faults.gate.gate import (
    EVERY_FRAME,
    DelayRule,
    GatedLink,
    GateRule,
)
from pnfarm.links.base import PortSpec
from pnfarm.links.memory import MemoryLink, MemorySwitch

MACS = bytes.fromhex("020000000001020000000002")


class Late:
    """Says one wait after the other."""

    def __init__(self, *waits: int) -> None:
        self.waits, self.told = list(waits), []

    def asked(self, now: int) -> int:
        del now
        return self.waits.pop(0) if self.waits else 0

    def left(self, *, sent: bool) -> None:
        self.told.append(sent)


class Wire:
    """A gated link of one port whose frames are kept as (time, frame)."""

    def __init__(self) -> None:
        self.now, self.sent = 0, []
        switch = MemorySwitch()
        self.link = GatedLink(MemoryLink(switch, lambda: self.now), lambda: self.now)
        (port,) = asyncio.run(self.link.open([PortSpec("a", MACS[6:])]))
        self.port = port.index
        # the class of a frame is its first letter
        self.link.classify(self.port, lambda frame: frame[:1].decode())
        self.link.inner.send = lambda _port, frame: self.sent.append((self.now, frame))

    def at(self, now: int, *frames: bytes) -> None:
        self.now = now
        self.link.handle_timeout(now)
        for frame in frames:
            self.link.send(self.port, frame)


def test_a_frame_held_back_leaves_at_its_time_and_none_of_its_kind_overtakes_it():
    wire, late = Wire(), Late(100, 0, 20)
    rule = DelayRule({"r"}, late)
    wire.link.delay(wire.port, rule)
    wire.at(10, b"r1", b"other", b"r2")
    assert wire.sent == [(10, b"other")]
    assert wire.link.next_deadline() == 110
    wire.at(50, b"r3")
    wire.at(109)
    assert len(wire.sent) == 1
    wire.at(110)
    assert wire.sent[1:] == [(110, b"r1"), (110, b"r2"), (110, b"r3")]
    assert late.told == [True, True]
    assert wire.link.next_deadline() is None
    wire.at(120, b"r4")
    assert wire.sent[-1] == (120, b"r4")


def test_two_delays_add_up_and_the_last_one_to_go_lets_everything_leave():
    wire, one, two = Wire(), Late(100, 1000), Late(50, 1000)
    rules = [DelayRule(EVERY_FRAME, one), DelayRule(EVERY_FRAME, two)]
    for rule in rules:
        wire.link.delay(wire.port, rule)
    wire.at(0, b"a")
    wire.at(150, b"b")
    assert wire.sent == [(150, b"a")]
    wire.link.undelay(wire.port, rules[0])
    assert len(wire.sent) == 1
    wire.link.undelay(wire.port, rules[1])
    assert wire.sent[1:] == [(150, b"b")]
    assert (one.told, two.told) == ([True, True], [True, True])


def test_frames_of_a_sender_without_supply_never_leave():
    wire, late = Wire(), Late(100)
    wire.link.delay(wire.port, DelayRule(EVERY_FRAME, late))
    wire.at(0, b"a")
    wire.link.forget(wire.port)
    wire.at(200)
    assert (wire.sent, late.told) == ([], [False])


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 80)), max_size=20))
def test_whatever_the_waits_frames_keep_their_order_and_none_is_lost(steps):
    wire, late = Wire(), Late(*(wait for _, wait in steps))
    rule = DelayRule(EVERY_FRAME, late)
    wire.link.delay(wire.port, rule)
    now = 0
    for index, (pause, _) in enumerate(steps):
        now += pause
        wire.at(now, bytes([index]))
    wire.link.undelay(wire.port, rule)
    assert [frame[0] for _, frame in wire.sent] == list(range(len(steps)))
    assert late.told == [True] * sum(wait > 0 for _, wait in steps)


def test_a_rule_may_let_something_else_pass_and_another_still_loses_it():
    wire = Wire()
    wire.link.add(wire.port, GateRule(("out",), instead=lambda frame: frame + b"!"))
    wire.at(0, b"a")
    assert wire.sent == [(0, b"a!")]
    lossy = GateRule(("out",))
    wire.link.add(wire.port, lossy)
    wire.at(1, b"b")
    assert len(wire.sent) == 1
    assert lossy.evidence().activations == 1


def test_a_rule_acts_on_frames_of_its_classes_alone_and_the_port_says_which_class_a_frame_is_of():
    wire = Wire()
    rule = GateRule(("out",), {"r", "s"})
    wire.link.add(wire.port, rule)
    wire.at(0, b"r1", b"other", b"s1", b"")
    assert [frame for _, frame in wire.sent] == [b"other", b""]
    assert (rule.evidence().checks, rule.evidence().activations) == (2, 2)
    assert wire.link.in_force(wire.port) == [rule]
    wire.link.remove(wire.port, rule)
    assert wire.link.in_force(wire.port) == []


def test_a_rule_counts_both_ways_together_and_rests_at_its_count():
    told = []
    rule = GateRule(("out", "in"), EVERY_FRAME, count=3, lost=lambda: told.append(1))
    assert [rule.loses(direction, "", now) for now, direction in enumerate(("out", "in", "out", "in"), 1)] == [
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
    assert not GateRule(("out",), EVERY_FRAME, stop_ns=100).loses("out", "", 100)
    spent = [1]
    rule = GateRule(("out",), EVERY_FRAME, count=2, spent=lambda: spent[0])
    assert rule.loses("out", "", 1)
    assert not rule.loses("out", "", 2)


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
    config = parse_farm(FILE.replace("WHAT", what).replace("WHOM", whom))
    line = asyncio.run(VirtualLine.create(config))
    add_impairments(line.farm.injections, expand(config), line.world.now)
    return line.farm.injections


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
            "impair[0] of drives press to press: fault.kind: 'sielnce' is not a kind of fault, did you mean",
        ),
        ("silence", "axis-01", "impair[0] of drives press to press: `on` means none of them"),
        ("drive-fault", "all", "fault.params.fault: is missing"),
    ],
)
def test_a_wrong_fault_of_a_farm_file_is_reported_with_its_place(what, whom, told):
    with pytest.raises(ConfigError) as caught:
        impaired(what, whom)
    assert told in str(caught.value)
