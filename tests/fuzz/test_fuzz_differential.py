"""Other implementations and ours on the same input; ``make fuzz ARGS="--against PEER"`` gives them more."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from shutil import which

import pytest
from forks import run_fork

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
    if which("tshark") is None:
        pytest.skip("needs the tool `tshark`")
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
            if peer != "opener":
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
