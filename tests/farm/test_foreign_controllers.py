"""Start-ups of foreign controllers, habit by habit, against a drive in virtual time.

Each row holds what a captured controller does otherwise than the others; the octets are made here, by none of the
project's codecs.  Captured are S7-1500, S7-1200, WinAC, PC WorX, CODESYS and Bosch Rexroth (Hilscher); PN Driver by its
frame id.
"""

import struct
from ipaddress import IPv4Interface

import pytest
from foreign_controller import (
    AR_FSU,
    INTERFACE_ADJUST,
    MRP_ADJUST,
    MRP_CHECK,
    NO_CALL,
    ODD_RECORD,
    PLL_CONTROL,
    PORT_ADJUST,
    TRACE_UNIT,
    ForeignController,
    Habit,
)
from virtual_line import VirtualLine

from pnfarm.protocols.profinet.errors import RtaError

S7_RECORDS = (MRP_CHECK, MRP_ADJUST, INTERFACE_ADJUST, PORT_ADJUST)
HABITS = (
    Habit("s7-1500", properties=0x40000011, activity_timeout=200, frame_ids=(0x8000, 0x8000), alarm_length=256,
          announces_set=True, records=S7_RECORDS),
    Habit("s7-1500-containers", properties=0x60000011, activity_timeout=200, tail="000000fd002a", discards=True,
          announces_set=True, records=(*S7_RECORDS, PLL_CONTROL, TRACE_UNIT), writes="container"),
    Habit("s7-1500-legacy", alarm_length=256, phases=(2, 2), records=(AR_FSU, *S7_RECORDS)),
    Habit("s7-1200", little_endian=False, tail="0064010d002a", ratio=512, alarm_length=256, only_telegram=True,
          records=()),
    Habit("s7-1200-frame-ids", little_endian=False, tail="0064010d002a", frame_ids=(0x8000, 0x8010), ratio=2,
          alarm_length=256, records=S7_RECORDS, ping=True),
    Habit("pn-driver", tail="006400fa002a", frame_ids=(0xBBF0, 0xFFFF), send_clock=8, ratio=8, phases=(4, 4),
          properties=0x40000011, activity_timeout=200, discards=True, announces_set=True,
          records=(AR_FSU, MRP_CHECK, MRP_ADJUST, INTERFACE_ADJUST, PLL_CONTROL, PORT_ADJUST, TRACE_UNIT)),
    Habit("winac", tail="00640113002a", rt_class=1, frame_ids=(0xC001, 0xC002), ratio=2, alarm_length=256),
    Habit("pc-worx", little_endian=False, tail="0001003c00b0", rt_class=1, frame_ids=(0xC002, 0xFFFF), ratio=8,
          phases=(7, 8), factor=24, alarm_timeout=5, alarm_reference=0x8001, missing=((0, 2),), silent=((0, 0x8001),),
          records=()),
    Habit("codesys", properties=0x40000011, activity_timeout=300, tail="0001008802cc", frame_ids=(0x8001, 0xFFFF),
          ratio=4, alarm_early=True, alarm_length=226),
    Habit("bosch-rexroth", tail="00012201011f", references=(53, 54), frame_ids=(0x8002, 0xFFFF), ratio=1,
          alarm_early=True, alarm_timeout=10, alarm_reference=3, alarm_tags=(0xC004, 0xA004), writes="single"),
    Habit("vlan-everywhere", iocr_tag=0xC004, alarm_tags=(0xCFFF, 0xA001), ratio=4),
    Habit("one-expected-block", one_block=True, ratio=4, padding=0x0F,
          records=(INTERFACE_ADJUST, ODD_RECORD, PORT_ADJUST)),
)  # fmt: skip


@pytest.fixture(scope="module")
def line():
    """One AKD that takes every cycle, and no controller of ours."""
    return VirtualLine(limits="lax", controller=False)


@pytest.fixture(params=HABITS, ids=lambda habit: habit.name)
def plc(request, line):
    station = line.farm.axes[0]
    controller = ForeignController(line, IPv4Interface("10.77.1.7/23"), request.param, station)
    yield controller
    for ar in station.device.cm.ars:
        station.device.cm.abort(ar.key, RtaError.ABORT_REQUEST, controller.now)
    line.farm.settle(station.station, controller.now)
    line.world.switch.detach(controller.port.index)


def sent(line):
    """The drive's frame as it is prepared, and the step of its cycle counter."""
    (ar,) = line.farm.axes[0].device.ars.values()
    row, _ = ar.providers[0]
    ppm, frame = line.farm.columns.ppm[row], line.farm.columns.frames[row]
    octets = bytes(frame[: int(ppm.length)])
    return octets, int(ppm.counter_step)


def test_the_start_up_ends_in_data(line, plc):
    habit, station = plc.habit, plc.station
    aborts = dict(station.device.connections.aborts)
    if habit.ping:
        assert plc.ping() == NO_CALL
    blocks = plc.connect()
    ar_type, uuid, session, mac, port = struct.unpack(">H16sH6sH", blocks[0x8101][0])
    assert (ar_type, uuid, session, mac, port) == (1, plc.uuid.bytes, 1, station.port.mac, 0x8892)
    iocrs = {kind: (ref, frame_id) for kind, ref, frame_id in (struct.unpack(">HHH", b) for b in blocks[0x8102])}
    assert [iocrs[1][0], iocrs[2][0]] == list(habit.references)
    assert iocrs[1][1] == habit.frame_ids[0]
    usable = range(0xC000, 0xF800) if habit.rt_class == 1 else range(0x8000, 0xBC00)
    assert iocrs[2][1] in usable
    assert habit.frame_ids[1] in {0xFFFF, iocrs[2][1]}
    assert struct.unpack(">HHH", blocks[0x8103][0])[0] == 1
    if habit.missing:
        ((slot, subslot),) = habit.missing
        expected = struct.pack(">HIHH", 1, 0, 1, slot)[:8]
        (diff,) = blocks[0x8104]
        assert diff.startswith(expected)
        assert diff.endswith(struct.pack(">HHIH", 1, subslot, 0, 0x9800))
    else:
        assert 0x8104 not in blocks
    assert plc.write_records() == [0] * (1 if habit.writes == "container" else len(habit.records))
    plc.end_parameters()
    source, rest = plc.answer_ready()
    assert source != 34964, "a device calls from a port of its own"
    assert (rest == b"") == (not habit.missing)
    plc.feed()
    (ar,) = station.device.ars.values()
    assert ar.established
    assert station.device.connections.aborts == aborts
    plc.release()
    assert not station.device.ars


def test_the_drives_frames_are_laid_out_and_tagged_as_was_asked(line, plc):
    habit = plc.habit
    plc.connect()
    plc.write_records()
    plc.end_parameters()
    plc.answer_ready()
    plc.feed()
    octets, step = sent(line)
    frame, _ = plc._frames()
    assert octets[:12] == plc.mac + plc.station.port.mac
    assert octets[12:20] == struct.pack(">HHHH", 0x8100, habit.iocr_tag, 0x8892, habit.frame_ids[0])
    assert len(octets) == 20 + frame.length + 4
    assert step == habit.send_clock * habit.ratio
    data = octets[20:-4]
    assert octets[-2:] == b"\x35\0"
    statuses = set()
    lengths = {(p[1], p[3]): p[5] for p in plc._places()}
    for _, slot, subslot, offset in frame.data:
        length = lengths[slot, subslot]
        if length or not habit.discards:
            statuses.add(offset + length)
    statuses |= {offset for *_, offset in frame.iocs}
    assert {data[place] for place in statuses} == {0x80}
    (telegram,) = [offset for _, slot, subslot, offset in frame.data if lengths[slot, subslot]]
    assert int.from_bytes(data[telegram : telegram + 2], "big") & 0x0040, "ZSW1 says switching on inhibited"
    rest = [at for at in range(len(data)) if at not in statuses and not telegram <= at < telegram + 4]
    assert all(data[at] == 0 for at in rest)


def test_what_was_written_is_read_back(line, plc):
    plc.connect()
    plc.write_records()
    for slot, subslot, index, data in plc.habit.records:
        assert plc.read(slot, subslot, index) == (0, data)
    status, _ = plc.read(0, 0x8000, 0x80B0)
    assert status == 0xDE80B000, "a container is written only"
    status, octets = plc.read(0, 0, 0xE050)
    assert status == 0
    assert bool(octets) == (plc.habit.announces_set or AR_FSU in plc.habit.records)
