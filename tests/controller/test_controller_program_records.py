"""Records that a PLC program of one's own reads and writes: of the drive, or of one axis of several."""

from __future__ import annotations

import asyncio
import struct

import pytest

from pnfarm.controller.line import VirtualLine
from pnfarm.controller.program_record import MOST_OPEN
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

FILE = """
farm: records
link: {{kind: memory}}
drives:
  - name: cu
    model: profidrive
    limits: lax
    ip: 10.77.0.11/24
    axes: [{{name: x, telegram: 1}}, {{name: y, telegram: 111}}]
controller:
  ip: 10.77.0.1/24
  cycle: 2ms
  program: {{python: "{program}"}}
"""
LOCAL = 0xB02E
#: Base mode parameter access: read PNU 922, the telegram.
TELEGRAM = struct.pack(">4B2BHH", 1, 1, 0, 1, 0x10, 1, 922, 0)
ASKS_ONCE = f"""
from pnfarm import AxisProgram

class Mine(AxisProgram):
    asked = answer = None

    def cycle(self, inputs, outputs, now):
        turn = self.name == "cu.x" or (self.line["cu.x"].answer is not None and self.line["cu.x"].answer.done)
        if inputs.valid and self.asked is None and turn:
            self.asked = self.write_record({LOCAL}, {TELEGRAM!r})
        if self.asked is not None and self.asked.done and self.answer is None:
            self.answer = self.read_record({LOCAL})
"""


def open_line(path, source: str) -> VirtualLine:
    path.write_text(source)
    return asyncio.run(VirtualLine.create(parse_farm(FILE.format(program=path)), plc_log=EventLog(quiet=True)))


@pytest.fixture
def line(tmp_path):
    opened = open_line(tmp_path / "mine.py", ASKS_ONCE)
    yield opened
    asyncio.run(opened.close())


def test_each_axis_of_a_drive_is_asked_at_its_own_access_point(line):
    programs = [line.programs.program(name) for name in ("cu.x", "cu.y")]
    assert line.world.run(5, until=lambda: all(one.answer is not None and one.answer.done for one in programs))
    assert [struct.unpack_from(">H", one.answer.data, 6) for one in programs] == [(1,), (111,)]
    assert [(one.asked.data, one.asked.failure, one.asked.status) for one in programs] == [(b"", "", 0)] * 2


def test_in_real_time_an_access_begins_where_the_controller_runs(line):
    handed = []
    line.programs._carry = handed.append
    program = line.programs.program("cu.x")
    assert line.world.run(5, until=lambda: program.asked is not None)
    line.world.run(1)
    assert not program.asked.done
    for begin in handed:
        begin(line.world.now)
    assert line.world.run(1, until=lambda: program.asked.done)
    assert program.asked.failure == ""


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("self.read_record(-1)", "record index -1: allowed are 0 to 65535"),
        ("self.read_record(0x10000)", "record index 65536: allowed are 0 to 65535"),
        ("self.read_record('47')", "record index '47': allowed are 0 to 65535"),
        ("self.write_record(47, b'')", "the data of a record are 1 to 4096 octets, as bytes"),
        ("self.write_record(47, bytes(4097))", "the data of a record are 1 to 4096 octets, as bytes"),
        ("self.write_record(47, [1])", "the data of a record are 1 to 4096 octets, as bytes"),
        ("self.read_record(47)", f"{MOST_OPEN} accesses to records are not done; one more is refused"),
    ],
)
def test_what_cannot_be_asked_stops_the_axis_with_a_sentence(tmp_path, call, message):
    head = "from pnfarm import AxisProgram\n\nclass Mine(AxisProgram):\n    def cycle(self, inputs, outputs, now):\n"
    line = open_line(tmp_path / "mine.py", f"{head}        {call}\n")
    line.programs._carry = lambda begin: None
    assert line.world.run(1, until=lambda: line.programs.snapshot("cu")["failure"])
    assert line.programs.snapshot("cu")["failure"] == f"{tmp_path}/mine.py:5: ValueError: {message}"
    asyncio.run(line.close())


def test_an_access_without_a_connection_fails_with_the_reason(tmp_path):
    source = ASKS_ONCE.replace("inputs.valid and ", "")
    line = open_line(tmp_path / "mine.py", source)
    program = line.programs.program("cu.x")
    assert line.world.run(1, until=lambda: program.asked is not None and program.asked.done)
    assert program.asked.failure.startswith("there is no connection")
    assert (program.asked.data, program.asked.status) == (b"", 0)
    asyncio.run(line.close())


SEVERAL = """
from pnfarm import AxisProgram

class Mine(AxisProgram):
    def cycle(self, inputs, outputs, now):
        if self.name == "cu.y":
            raise ValueError("the second axis")
"""


def test_programs_have_the_names_of_their_axes_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(SEVERAL)
    text = FILE.format(program=path).replace(
        "controller:", "  - {name: solo, model: profidrive, telegram: 1, ip: 10.77.0.12/24}\ncontroller:"
    )
    log = EventLog(quiet=True)
    line = asyncio.run(VirtualLine.create(parse_farm(text), plc_log=log))
    assert [axis.name for axis in line.programs.line] == ["cu.x", "cu.y", "solo"]
    assert [axis.configured_name for axis in line.farm.axes] == ["cu.x", "cu.y", "solo"]
    line.world.run(0.1)
    assert [entry.drive for entry in log.entries() if entry.event == "axis program failed"] == ["cu.y"]
    # the drive's row shows what stands in its way
    assert [row["program"]["errors"] for row in line.joined.summary()] == [1, 0]
    asyncio.run(line.close())
