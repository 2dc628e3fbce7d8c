"""A drive's parameter channel while others than its controller look at its records too."""

from __future__ import annotations

from ipaddress import IPv4Interface

from bystander import Bystander
from record_line import API, reading, record
from virtual_line import VirtualLine

from pnfarm.protocols.profinet.cm.controller.events import RecordRead

PARAMETERS = 47


def ask(line: VirtualLine, request: bytes) -> None:
    session = line.plc.sessions[0]
    line.plc.records.clear()
    session.machine.write_record("write", API, 1, 1, PARAMETERS, request)
    line.plc.touch(session, line.world.now)
    assert line.world.run(1.0, until=lambda: bool(line.plc.records))


def answer(line: VirtualLine) -> bytes | None:
    event = record(line, 1, 1, PARAMETERS, api=API)
    assert isinstance(event, RecordRead)
    return event.data


def test_a_tool_that_reads_every_record_takes_no_answer_away_from_the_controller():
    line = VirtualLine()
    line.connect()
    tool = Bystander(line.world, "tool", bytes([2, 0, 0, 0x77, 0, 1]), IPv4Interface("10.77.1.77/23"))
    ask(line, reading((930, 0, 1)))
    assert tool.read_without(line.farm.axes[0], PARAMETERS, API, 1, 1) is None, "it asked for nothing"
    assert answer(line) == bytes.fromhex("07 01 00 01 42 01 0001")
    assert answer(line) is None


def test_a_connection_that_ended_leaves_no_answer_for_the_next_one():
    line = VirtualLine()
    line.connect()
    ask(line, reading((930, 0, 1)))
    line.plc.columns.ppm["active"] = 0
    assert line.world.run(2.0, until=lambda: not line.plc.all_connected)
    line.connect()
    assert answer(line) is None
