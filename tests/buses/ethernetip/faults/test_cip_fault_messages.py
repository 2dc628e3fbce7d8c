"""Faults in sessions and explicit messages of a drive on EtherNet/IP, as its peer sees them."""

from __future__ import annotations

import pytest
from cip_line import Peer, Rig, io_path

from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.protocols.enip.originator_events import (
    ConnectionMade,
    ConnectionNotMade,
    RequestAnswered,
    RequestFailed,
    SessionRegistered,
)
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.epath import ElectronicKey, emit_epath, logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.wire.endpoint import Datagram, DatagramReceived

IDENTITY, PARAMETER, CONTROLLER = 0x01, 0x0F, 0x25
LIST_IDENTITY = bytes.fromhex("6300") + bytes(22)


class Faulty(Rig):
    """One peer by hand, and faults of its drive."""

    def add(self, kind: str, on: object = "axis-1", **fields):
        return self.farm.injections.inject({"kind": kind, "on": on, **fields}, self.world.now)

    def clear(self) -> None:
        self.farm.injections.clear(None, self.world.now)
        self.peer.run(0.002)
        assert self.farm.injections.drive("axis-1").in_force() == {}


@pytest.fixture
def rig() -> Faulty:
    found = Faulty()
    found.peer.connect()
    return found


def ask(rig: Faulty, path: bytes = logical_path(IDENTITY, 1, 1)) -> int:
    number = rig.peer.originator.request(message_request(Service.GET_ATTRIBUTE_SINGLE, path), rig.world.now)
    rig.peer.pump()
    return number


def answer(peer: Peer, number: int) -> RequestAnswered | RequestFailed | None:
    kinds = RequestAnswered | RequestFailed
    return next((note for note in peer.notes if isinstance(note, kinds) and note.number == number), None)


def took(rig: Faulty, number: int, within: float = 2.0) -> float | None:
    """Seconds until the answer."""
    begin = rig.world.now
    if not rig.world.run(within, until=lambda: answer(rig.peer, number) is not None):
        return None
    return (rig.world.now - begin) / 1e9


# -- opening a connection ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("params", "status", "extended"),
    [
        ({}, 0x01, (0x0113,)),
        ({"extended": "ownership-conflict"}, 0x01, (0x0106,)),
        ({"extended": 0x0315}, 0x01, (0x0315,)),
        ({"status": "privilege-violation"}, 0x0F, ()),
        ({"status": 2, "extended": 7}, 0x02, (7,)),
    ],
)
def test_connect_refuse_gives_its_status_so_often_and_then_lets_the_originator_in(rig, params, status, extended):
    fault = rig.add("connect-refuse", count=2, params=params)
    for _ in range(2):
        made = rig.peer.open()
        assert isinstance(made, ConnectionNotMade)
        assert (made.reply.status, made.reply.extended) == (status, extended)
    assert isinstance(rig.peer.open(), ConnectionMade)
    assert fault.state == "ended"
    assert (fault.evidence().activations, fault.evidence().confirmed) == (2, True)
    assert "connection refused" in rig.texts()


def test_connect_refuse_leaves_a_connection_that_stands_and_explicit_ones_alone(rig):
    assert isinstance(rig.peer.open(), ConnectionMade)
    rig.add("connect-refuse")
    rig.peer.run(0.5)
    assert rig.station().device.connected
    assert rig.peer.get(IDENTITY, 1, 1).status == 0
    rig.clear()


@pytest.mark.parametrize("param", ["code1", "code2"])
def test_parameters_of_another_bus_are_refused_in_plain_words(rig, param):
    with pytest.raises(InjectionError, match=f"params.{param}: is for drives on PROFINET, which axis-1 is not"):
        rig.add("connect-refuse", params={param: 5})


def test_a_late_answer_to_forward_open_makes_the_originator_wait_and_other_sessions_do_not():
    rig = Faulty(peers=2)
    for peer in rig.peers:
        peer.connect()
    fault = rig.add("forward-open-delay", params={"delay": "300ms"}, count=1)
    number = rig.peer.originator.forward_open(rig.peer.asked(), rig.world.now)
    rig.peer.pump()
    assert rig.peers[1].get(IDENTITY, 1, 1).status == 0
    begin = rig.world.now
    assert rig.world.run(
        1.0, until=lambda: any(isinstance(n, ConnectionMade) and n.number == number for n in rig.peer.notes)
    )
    assert 0.25 < (rig.world.now - begin) / 1e9 < 0.31
    rig.peer.run(0.1)
    assert fault.state == "ended"
    assert fault.evidence().confirmed


def test_another_identity_fails_the_key_of_the_right_product_and_is_undone(rig):
    own = ElectronicKey(452, 16, 1, 1, 13)
    fault = rig.add("identity-change", params={"vendor": 1, "minor": 99})
    assert rig.peer.get(IDENTITY, 1, 1).data == b"\1\0"
    assert rig.peer.get(IDENTITY, 1, 4).data == bytes([1, 99])
    made = rig.peer.open(path=emit_epath([own]) + io_path())
    assert isinstance(made, ConnectionNotMade)
    assert made.reply.extended == (0x0114,)
    assert fault.evidence().confirmed
    rig.station().station.power_cycle(rig.world.now)
    rig.peer.run(1.0)
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).data == b"\1\0", "also after a boot"
    rig.clear()
    assert rig.peer.get(IDENTITY, 1, 1).data == (452).to_bytes(2, "little")
    assert isinstance(rig.peer.open(path=emit_epath([own]) + io_path()), ConnectionMade)


def test_an_identity_is_undone_on_a_drive_that_booted_while_it_had_no_fault(rig):
    rig.station().station.power_cycle(rig.world.now)
    rig.peer.run(1.0)
    rig.peer.connect()
    rig.add("identity-change", params={"vendor": 1})
    rig.peer.run(0.5)
    assert rig.peer.get(IDENTITY, 1, 1).data == b"\1\0"
    rig.clear()
    assert rig.peer.get(IDENTITY, 1, 1).data == (452).to_bytes(2, "little")


def test_two_changes_of_the_identity_end_in_any_order(rig):
    first = rig.add("identity-change", params={"vendor": 1})
    rig.add("identity-change", params={"vendor": 2, "serial": 5})
    assert rig.peer.get(IDENTITY, 1, 1).data == b"\2\0"
    rig.farm.injections.clear(first.id, rig.world.now)
    assert rig.peer.get(IDENTITY, 1, 1).data == b"\2\0"
    rig.clear()
    assert rig.peer.get(IDENTITY, 1, 1).data == (452).to_bytes(2, "little")


def test_left_out_all_the_product_code_is_another(rig):
    rig.add("identity-change")
    assert rig.peer.get(IDENTITY, 1, 3).data != b"\1\0"
    rig.clear()


# -- sessions ----------------------------------------------------------------------------------------------------------


def test_the_drive_closes_the_session_and_cyclic_data_go_on(rig):
    assert isinstance(rig.peer.open(), ConnectionMade)
    rig.peer.run(0.1)
    fault = rig.add("session-drop")
    rig.peer.run(0.1)
    assert rig.peer.closed
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    before = rig.peer.received(1)
    rig.peer.run(0.5)
    assert rig.peer.received(1) - before == 50
    assert "session ended" in rig.texts()


def test_each_session_is_closed_once_it_is_used_until_the_count_is_reached(rig):
    fault = rig.add("session-drop", count=3)
    for _ in range(2):
        rig.peer.run(0.1)
        assert rig.peer.closed
        rig.peer.originator, rig.peer.closed, rig.peer.notes = type(rig.peer.originator)(), [], []
        rig.peer.stream = rig.peer.link.sockets.connect(rig.peer.port.index, (rig.peer.target, 44818))
    rig.peer.run(0.1)
    assert fault.state == "ended"
    assert fault.evidence().activations == 3
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).status == 0


def test_tcp_refused_leaves_what_stands_and_lets_nobody_in_also_after_a_boot():
    rig = Faulty(peers=2)
    rig.peer.connect()
    rig.add("tcp-refuse")
    rig.add("tcp-refuse")
    assert rig.peer.get(IDENTITY, 1, 1).status == 0
    other = rig.peers[1]
    other.stream = other.link.sockets.connect(other.port.index, (other.target, 44818))
    other.run(0.1)
    assert other.closed
    rig.station().station.power_cycle(rig.world.now)
    rig.peer.run(1.0)
    other.closed = []
    other.stream = other.link.sockets.connect(other.port.index, (other.target, 44818))
    other.run(0.1)
    assert other.closed
    rig.clear()
    other.connect()
    assert other.get(IDENTITY, 1, 1).status == 0


def test_another_session_handle_than_the_peers_is_in_the_answer(rig):
    session = next(note.session for note in rig.peer.notes if isinstance(note, SessionRegistered))
    heard = []
    fault = rig.add("encapsulation-error", params={"what": "session"}, count=1)
    rig.peer.link.sockets.set_user(lambda event, now: heard.append(event.data))
    for _ in range(2):
        ask(rig)
        rig.peer.run(0.1)
    assert [int.from_bytes(data[4:8], "little") - session for data in heard] == [1, 0]
    assert fault.state == "ended"


@pytest.mark.parametrize(
    ("what", "reason"), [("status", "encapsulation status 0x64"), ("context", ""), ("garbage", "")]
)
def test_answers_with_a_wrong_encapsulation_are_no_answers(rig, what, reason):
    fault = rig.add("encapsulation-error", params={"what": what}, count=1)
    number = ask(rig)
    rig.peer.run(0.5)
    note = answer(rig.peer, number)
    assert not isinstance(note, RequestAnswered)
    if reason:
        assert isinstance(note, RequestFailed)
        assert note.reason == reason
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).status == 0


def test_a_header_that_announces_more_than_comes_keeps_the_peer_waiting(rig):
    rig.add("encapsulation-error", params={"what": "length", "by": 40}, count=1)
    number = ask(rig)
    rig.peer.run(0.5)
    assert answer(rig.peer, number) is None
    ask(rig)
    rig.peer.run(0.5)
    assert not any(isinstance(note, RequestAnswered) for note in rig.peer.notes), "the next answer is eaten"


# -- explicit messages -------------------------------------------------------------------------------------------------


def test_slow_answers_keep_their_order_and_cyclic_data_go_on(rig):
    assert isinstance(rig.peer.open(), ConnectionMade)
    fault = rig.add("rpc-delay", params={"delay": "200ms", "jitter": "50ms"})
    numbers = [ask(rig) for _ in range(3)]
    before = rig.peer.received(1)
    rig.peer.run(1.0)
    answered = [note.number for note in rig.peer.notes if isinstance(note, RequestAnswered)]
    assert answered[-3:] == numbers
    assert rig.peer.received(1) - before == 100
    assert fault.evidence().activations == 3
    rig.clear()


def test_record_delay_is_of_objects_alone_and_rpc_delay_of_all(rig):
    rig.add("record-delay", params={"delay": "300ms"})
    assert isinstance(rig.peer.open(), ConnectionMade), "Forward_Open is answered in time"
    assert took(rig, ask(rig)) == pytest.approx(0.3, abs=0.01)
    rig.clear()
    assert took(rig, ask(rig)) < 0.01
    rig.add("rpc-delay", params={"delay": "300ms"})
    rig.peer.originator.forward_open(rig.peer.asked(), rig.world.now)
    rig.peer.pump()
    rig.peer.run(0.25)
    assert not any(isinstance(note, ConnectionNotMade) for note in rig.peer.notes)
    rig.peer.run(0.1)
    assert any(isinstance(note, ConnectionNotMade) for note in rig.peer.notes), "of a second owner"
    rig.clear()


def test_what_a_delay_holds_leaves_when_it_ends(rig):
    rig.add("rpc-delay", params={"delay": "5s"})
    number = ask(rig)
    rig.peer.run(0.1)
    assert answer(rig.peer, number) is None
    rig.clear()
    rig.peer.run(0.01)
    assert isinstance(answer(rig.peer, number), RequestAnswered)


@pytest.mark.parametrize("direction", ["in", "out", "both"])
def test_explicit_silence_takes_whole_messages_and_leaves_the_stream_readable(rig, direction):
    assert isinstance(rig.peer.open(), ConnectionMade)
    fault = rig.add("rpc-silence", direction=direction)
    number = ask(rig)
    assert took(rig, number, 0.5) is None
    assert fault.evidence().activations == 1
    assert rig.station().device.connected
    rig.clear()
    assert took(rig, ask(rig)) < 0.01
    assert answer(rig.peer, number) is None, "what was lost never comes"


def test_explicit_silence_is_of_datagrams_too(rig):
    heard = []
    rig.add("rpc-silence", on="axis-1")
    rig.peer.link.sockets.set_user(lambda event, now: heard.append(event))
    action = Datagram(44818, (rig.peer.target, 44818), LIST_IDENTITY)
    rig.peer.link.sockets.act(rig.peer.port.index, action)
    rig.peer.run(0.5)
    assert not heard
    rig.clear()
    rig.peer.link.sockets.act(rig.peer.port.index, action)
    rig.peer.run(0.5)
    assert [type(event) for event in heard] == [DatagramReceived]


def test_errors_are_for_chosen_class_instance_and_attribute(rig):
    number = rig.station().model.resolve("DRV.OPMODE")[0].pnu
    fault = rig.add("record-error", params={"status": "privilege-violation", "extended": 3})
    reply = rig.peer.get(PARAMETER, number, 1)
    assert (reply.status, reply.extended) == (GeneralStatus.PRIVILEGE_VIOLATION, (3,))
    assert rig.peer.get(CONTROLLER, 1, 3).status == GeneralStatus.PRIVILEGE_VIOLATION
    assert rig.peer.get(IDENTITY, 1, 1).status == 0, "not one of the drive's own"
    assert fault.evidence().activations == 2
    rig.clear()
    rig.add("record-error", params={"status": 0x0C, "class": IDENTITY, "instance": 1, "attribute": 7})
    assert rig.peer.get(IDENTITY, 1, 7).status == 0x0C
    assert rig.peer.get(IDENTITY, 1, 1).status == 0
    assert rig.peer.get(PARAMETER, number, 1).status == 0
    rig.station().station.power_cycle(rig.world.now)
    rig.peer.run(1.0)
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 7).status == 0x0C, "also after a boot"
    rig.clear()
    assert rig.peer.get(IDENTITY, 1, 7).status == 0


def test_an_error_is_given_so_often(rig):
    fault = rig.add("record-error", count=2)
    number = rig.station().model.resolve("DRV.OPMODE")[0].pnu
    assert [rig.peer.get(PARAMETER, number, 1).status for _ in range(3)] == [0x10, 0x10, 0]
    assert fault.state == "ended"


def test_an_attribute_alone_names_nothing(rig):
    with pytest.raises(InjectionError, match="attributes of different classes share numbers"):
        rig.add("record-error", params={"attribute": 3})


# -- what the line does to streams and datagrams -----------------------------------------------------------------------


def test_silence_makes_what_is_on_tcp_late_and_nothing_is_lost_of_it(rig):
    fault = rig.add("silence")
    number = ask(rig)
    assert took(rig, number, 1.0) is None
    assert fault.evidence().activations >= 4, "TCP repeats"
    rig.clear()
    rig.peer.run(0.01)
    assert isinstance(answer(rig.peer, number), RequestAnswered)


def test_loss_on_tcp_costs_time_and_no_message(rig):
    rig.add("loss", probability=0.5, seed=2, params={"frames": "streams"})
    times = [took(rig, ask(rig), 5.0) for _ in range(20)]
    assert all(time is not None for time in times)
    assert any(time > 0.19 for time in times)
    rig.clear()


def test_delay_of_streams_is_in_order(rig):
    rig.add("delay", direction="in", params={"delay": "50ms", "jitter": "50ms", "frames": "streams", "overtake": True})
    numbers = [ask(rig) for _ in range(5)]
    rig.peer.run(1.0)
    assert [note.number for note in rig.peer.notes if isinstance(note, RequestAnswered)] == numbers
    rig.clear()


def test_corrupt_octets_of_a_message_reach_the_drive(rig):
    fault = rig.add("corrupt", direction="in", seed=6, params={"frames": "streams", "bits": 8})
    number = ask(rig)
    rig.peer.run(0.2)
    assert fault.evidence().activations == 1
    note = answer(rig.peer, number)
    assert not (isinstance(note, RequestAnswered) and note.reply.status == 0 and note.reply.data == b"\xc4\x01")
    rig.clear()
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).status == 0


@pytest.mark.parametrize(
    ("kind", "why"),
    [("duplicate", "TCP discards repeated ones"), ("reorder", "TCP puts them in order")],
)
def test_what_tcp_prevents_is_refused_with_the_reason(rig, kind, why):
    with pytest.raises(InjectionError, match=why):
        rig.add(kind, params={"frames": "streams"})


def test_datagrams_can_come_twice(rig):
    heard = []
    rig.add("duplicate", params={"frames": "datagrams"}, direction="out")
    rig.peer.link.sockets.set_user(lambda event, now: heard.append(event))
    rig.peer.link.sockets.act(rig.peer.port.index, Datagram(44818, (rig.peer.target, 44818), LIST_IDENTITY))
    rig.peer.run(0.5)
    assert len(heard) == 2
    assert heard[0].data == heard[1].data
    rig.clear()


@pytest.mark.parametrize("word", ["rpc", "dcp", "lldp", "alarms", "arp"])
def test_a_class_of_frames_that_the_bus_has_not_is_refused(rig, word):
    with pytest.raises(InjectionError, match=r"axis-1 has no frames of this class on its bus; .*datagrams, streams"):
        rig.add("loss", params={"frames": word})


def test_a_slow_line_makes_long_answers_late_and_loses_none(rig):
    rig.add("throttle", direction="out", params={"frames": "streams", "rate": 8, "queue": "1ms"})
    numbers = [ask(rig) for _ in range(5)]
    rig.peer.run(0.2)
    assert answer(rig.peer, numbers[-1]) is None
    rig.peer.run(1.5)
    assert all(isinstance(answer(rig.peer, number), RequestAnswered) for number in numbers)
    rig.clear()


def test_a_peer_that_asks_on_behind_a_silence_loses_its_stream_and_memory_is_bounded(rig):
    rig.add("silence", direction="both")
    for _ in range(1100):
        rig.peer.originator.request(
            message_request(Service.GET_ATTRIBUTE_SINGLE, logical_path(IDENTITY, 1, 1)), rig.world.now
        )
        rig.peer.originator._pending.clear()
        rig.peer.pump()
    rig.peer.run(0.1)
    assert rig.peer.closed
    rig.clear()
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).status == 0


def test_a_pulled_cable_keeps_the_session_and_a_power_cycle_does_not(rig):
    rig.add("link-down", **{"for": "500ms"})
    number = ask(rig)
    assert took(rig, number, 0.45) is None
    assert took(rig, number, 1.0) is not None
    rig.add("rpc-delay", params={"delay": "3s"})
    number = ask(rig)
    rig.add("power-cycle", params={"off": "300ms"})
    rig.peer.run(5.0)
    assert not isinstance(answer(rig.peer, number), RequestAnswered)
    rig.clear()
    rig.peer.connect()
    assert isinstance(rig.peer.notes[0], SessionRegistered)


# -- what there is not -------------------------------------------------------------------------------------------------

ABSENT = [
    "duplicate-ip", "duplicate-name", "provider-stop", "data-invalid", "iops-bad", "iocs-bad", "cycle-counter-freeze",
    "cycle-counter-jump", "wrong-frame-id", "sign-of-life-freeze", "sign-of-life-skip", "sign-of-life-loss",
    "no-application-ready", "late-application-ready", "dcp-silence", "module-missing", "module-wrong", "parameter-busy",
    "alarm-storm", "alarm-unacknowledged", "diagnosis",
]  # fmt: skip


@pytest.mark.parametrize("kind", ABSENT)
def test_what_the_bus_has_not_is_refused_with_a_reason(rig, kind):
    params = {"error": 1} if kind == "diagnosis" else {}
    with pytest.raises(ConfigError, match=r"fault\.kind: axis-1 is on EtherNet/IP: .{15}"):
        rig.add(kind, params=params)
    assert rig.farm.injections.list() == []
