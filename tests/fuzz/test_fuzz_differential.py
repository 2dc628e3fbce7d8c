"""Other implementations and ours on the same input; ``make fuzz ARGS="--against PEER"`` gives them more."""

from __future__ import annotations

import re
import subprocess
from argparse import Namespace
from pathlib import Path

import pytest
from forks import run_fork
from tools import needed

ROOT = Path(__file__).resolve().parents[2]


def against(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run_fork(ROOT / "tests" / "fuzz" / "__main__.py", *arguments, timeout=200)


@pytest.fixture
def differential(monkeypatch):
    for folder in ("", "tests/support", "tests/faults", "tests/protocols/enip", "tests/interop"):
        monkeypatch.syspath_prepend(str(ROOT / folder))
    from tests.fuzz import differential

    return differential


def test_no_difference_is_new():
    needed("tshark")
    done = against("--against", "scapy", "--against", "tshark", "--count", "600")
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.findall(r"^\d+ differences in (\d+) groups, 0 of them new$", done.stdout, re.MULTILINE)
    assert len(found) == 2, done.stdout
    assert all(int(groups) > 5 for groups in found), "nothing was compared"


def test_a_new_difference_is_told_with_its_shortest_input(differential, capsys):
    groups = differential.Groups()
    groups.add("dcp: xid differs", b"\1\2\3", 1, 2)
    groups.add("dcp: xid differs", b"\1\2", 3, 4)
    groups.add("lldp: we refuse (short)", b"\5", "short", {})
    assert groups.report({"lldp: *": "known"}) == 1
    said = capsys.readouterr().out
    assert "2  dcp: xid differs: NEW\n          input:  0102\n          ours:   3\n          theirs: 4\n" in said
    assert "1  lldp: we refuse (short): known" in said
    assert "3 differences in 2 groups, 1 of them new" in said
    assert groups.report({"*": "known"}) == 0


def test_answers_differ_in_class_or_in_a_field_that_both_have(differential):
    def kinds(mine, theirs):
        return list(differential.differences(mine, theirs))

    assert kinds("short", "malformed") == []
    assert kinds("short", {"xid": 1}) == ["we refuse (short)"]
    assert kinds({"xid": 1}, "malformed") == ["they refuse (malformed)"]
    assert kinds({"xid": 1, "name": None}, {"xid": 1, "name": "a", "more": 2}) == []
    assert kinds({"xid": 1, "service": 2}, {"xid": 2, "service": "absent"}) == ["xid differs", "service absent"]


def test_every_known_difference_has_a_reason_and_a_layer_that_is_compared(differential):
    for peer in differential.PEERS:
        for group, reason in differential.known(peer).items():
            assert reason, group
            if peer not in {"opener", "pnet"}:
                assert group.partition(":")[0] in {*differential.LAYERS, "*"}, group


def test_our_adapter_answers_sequences_as_a_stream(differential):
    from tests.fuzz.against_opener import Ours
    from tests.fuzz.enip_sequences import Sent, answer_class, sequence

    nop, unknown, lists = (bytes([command]) + bytes(23) for command in (0, 1, 4))
    register = b"\x65\0\4\0" + bytes(20) + b"\1\0\0\0"
    unregister = b"\x66" + bytes(23)
    given = [Sent("", octets) for octets in (nop, unknown, lists, register, unregister, lists)]
    answers = [one if isinstance(one, str) else answer_class(one) for one in Ours().answers(given)]
    assert answers == ["silence", "0x01 status 1", "0x04 status 0", "0x65 status 1", "closed"]
    assert [one.octets for one in sequence(1, 5)] == [one.octets for one in sequence(1, 5)]
    assert sequence(1, 5) != sequence(2, 5)


def test_opener_is_a_program_that_must_be_named(differential):
    done = against("--against", "opener")
    assert done.returncode == 2
    assert "--opener PATH" in done.stderr


def test_pnet_is_a_program_and_a_file_that_must_be_named(differential, capsys):
    options = Namespace(against=["pnet"], pnet=None, pnet_gsdml="no such file")
    assert differential.main(options) == 2
    told = capsys.readouterr().err
    assert "--pnet PATH" in told
    assert "--pnet-gsdml PATH" in told


@pytest.fixture
def example(differential):
    """The example island under the name and the address of p-net's sample: what the file says of it, and ours."""
    from device_cell import CONFIGS, ISLAND

    from pnfarm.buses.profinet.gsdml_file import load_gsdml
    from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
    from tests.fuzz.pnet.base import ADDRESS, NAME
    from tests.fuzz.pnet.rig import Ours

    device = from_gsdml(load_gsdml(CONFIGS / ISLAND), dap="DAP 1", modules={1: "16DI", 2: "8DO"})
    farm = f"""devices:
  - {{name: {NAME}, gsdml: {ISLAND}, access_point: DAP 1, ip: {ADDRESS}/24, slots: {{1: 16DI, 2: 8DO}}}}
"""
    return device, Ours(device, farm)


def test_our_device_answers_a_whole_connection(example):
    from random import Random

    from pnfarm.protocols.profinet.wire.block import BlockType
    from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum
    from tests.fuzz.pnet.base import Caller, Sent
    from tests.fuzz.pnet.dcp import set_address

    device, ours = example
    caller = Caller(Random(1), device)

    def prm_end():
        return caller.call("", Opnum.CONTROL, caller.control(BlockType.PRM_END_REQ, 1))

    # calls are numbered in the order in which they are made here
    sent = [set_address(), caller.connect(), prm_end(), Sent("", b"", "ready"), prm_end(), Sent("", b"\5")]
    sent += [caller.call("", 6, b""), Sent("", b"", "ready"), caller.release("")]
    assert ours.answers(sent) == [
        "1/2: 0",
        "OK AR_RES IOCR_RES IOCR_RES ALARM_CR_RES",
        "OK PRM_END_RES",
        "calls operation 4 APPLICATION_READY_REQ",
        "DD 81 40 06",
        "silence",
        "reject 0x1C010002",
        "silence",
        "OK RELEASE_RES",
    ]


def test_sequences_for_a_profinet_device_follow_from_the_seed_and_are_over_when_they_end(example):
    from tests.fuzz.pnet.sequences import sequence

    device, ours = example
    assert sequence(device, 1, 5) == sequence(device, 1, 5)
    assert sequence(device, 1, 5) != sequence(device, 2, 5)
    # raises where the device does not take a good connection behind one of them
    found = [ours.answers(sequence(device, 1, number)) for number in range(60)]
    assert len({one for answers in found for one in answers}) > 20


def test_answers_of_a_device_that_says_nothing_more(example):
    from tests.interop.pnet_talk import answers

    class Deaf:
        def __init__(self, *heard):
            self.heard, self.now, self.sent = list(heard), 0.0, []

        def send(self, how, octets):
            self.sent.append((how, octets))

        def more(self, seconds):
            self.now += 0.01
            return self.heard.pop(0) if self.heard else None

    def asked(*heard, how="dcp", octets=b"\xfe\xfd\3\0\0\0\0\7"):
        end = Deaf(*heard)
        return answers(end, [(how, octets), (how, octets)], lambda: end.now)

    probe, answer, late = (("dcp", b"\xfe\xfd\3\1" + xid + bytes(4)) for xid in (b"more", b"\0\0\0\7", b"\0\0\0\6"))
    assert asked() == ["no end"]
    assert asked(probe) == ["silence", "no end"]
    assert asked(late, answer, probe, probe) == [answer[1], "silence"]
    assert asked(late, how="ready") == ["silence", "silence"]


def test_what_follows_a_difference_of_a_profinet_device_is_not_compared(differential):
    from tests.fuzz.pnet.base import Sent
    from tests.fuzz.pnet.rig import compared

    sent = [Sent(str(number), b"") for number in range(3)]
    assert len(list(compared(sent, ["OK", "OK", "OK"], ["OK", "silence", "OK"]))) == 2
    assert list(compared(sent, ["OK", "OK"], ["OK", "ended"]))[-1][1:] == ("OK", "ended")


class Program:
    """Stands for the rig of another program, and for ours."""

    def __init__(self, *answers):
        self.given = answers

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def told(self):
        return "; and so on"

    def answers(self, _sequence):
        if "raise" in self.given:
            raise ValueError("no good")
        return list(self.given)


def behaviour(differential, mine, theirs, **options):
    from tests.fuzz.pnet.base import Sent
    from tests.fuzz.pnet.rig import compared

    given = Namespace(**{"count": 3, "turn": None, "seconds": None, "seed": 7} | options)
    sent = [Sent("a Connect of the same AR", b"\1"), Sent("what nobody knows", b"\2\3")]
    return differential._behaviour(given, "pnet", mine, theirs, lambda _: sent, compared)


def test_a_difference_in_behaviour_is_told_with_the_turn_that_repeats_it(differential, capsys):
    assert behaviour(differential, Program("OK", "OK"), Program("OK", "silence")) == 1
    told = capsys.readouterr().out
    assert "3 sequences, 6 messages" in told
    assert "; 3 answered alike; and so on\n" in told
    assert "3  what nobody knows: ours OK; theirs silence: NEW\n          input:  0203\n" in told
    assert "again:  --against pnet --seed 7 --turn 0\n" in told
    assert behaviour(differential, Program("DB 81 3D 00", "OK"), Program("silence", "OK"), turn=5) == 0
    told = capsys.readouterr().out
    assert "1 sequences, 1 messages" in told
    assert "a second Connect ends the AR" in told
    assert behaviour(differential, Program("OK"), Program("OK"), seconds=0) == 0
    assert "0 sequences" in capsys.readouterr().out


def test_an_exception_of_ours_is_a_finding(differential, capsys):
    assert behaviour(differential, Program("raise"), Program("OK"), turn=2) == 1
    told = capsys.readouterr().err
    assert "ValueError: no good" in told
    assert "what nobody knows: 0203\nagain: --against pnet --seed 7 --turn 2\n" in told
