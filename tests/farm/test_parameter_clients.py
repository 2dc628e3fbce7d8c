"""A drive's parameter channel while others than its controller look at its records too."""

from __future__ import annotations

from ipaddress import IPv4Interface

import pytest
from axes_line import AxesLine
from bystander import Bystander
from record_line import API, reading, record
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.records import RecordJob
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


SYSTEM = """
farm: system
link: {kind: memory}
drives:
  - name: s
    model: profidrive
    ip: 10.77.0.12/24
    realism: {parameter_latency: 100ms}
    axes: [{name: x, telegram: 105}, {name: y, telegram: 1}]
controller: {name: plc, ip: 10.77.0.250/24, cycle: 2ms}
"""
#: PNU 922: the telegram that is in force.
TELEGRAM = reading((922, 0, 1))


def call(line: AxesLine, slot: int, index: int, request: bytes | None = None) -> RecordJob:
    place, now = (API, slot, 1, index), line.world.now
    job = line.plc.read_record("s", place, now) if request is None else line.plc.write_record("s", place, request, now)
    assert line.world.run(2.0, until=lambda: job.done)
    return job


@pytest.mark.parametrize("index", [0xB02E, 0xB02F])
def test_requests_to_two_axes_of_one_station_do_not_displace_each_other(index):
    line = AxesLine(SYSTEM).connected()
    for slot in (1, 2):
        axis = slot if index == 0xB02F else 0
        request = TELEGRAM[:2] + bytes([axis]) + TELEGRAM[3:]
        assert not call(line, slot, index, request).failure
        assert "state conflict" in call(line, slot, index, request).failure, "the drive still works on its last one"
    assert "state conflict" in call(line, 1, index).failure
    line.run(0.2)
    # the one that was asked last is read first
    assert [int.from_bytes(call(line, slot, index).data[-2:], "big") for slot in (2, 1)] == [1, 105]
    assert [call(line, slot, index).data for slot in (1, 2)] == [None, None], "an answer is read once"


def test_a_connection_that_ended_leaves_the_answers_of_no_axis():
    line = AxesLine(SYSTEM).connected()
    for slot in (1, 2):
        assert not call(line, slot, 0xB02E, TELEGRAM).failure
    line.farm.injections.inject({"kind": "link-down", "on": ["s"], "for": "300ms"}, line.world.now)
    line.run(5.0)
    assert line.farm.station("s").device.connected
    assert [call(line, slot, 0xB02E).data for slot in (1, 2)] == [None, None]
