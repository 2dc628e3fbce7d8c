"""One channel for several axes and plain data, over an ideal wire in virtual time."""

import threading

import numpy as np
import pytest
from bench_axis import MS, VELOCITY_STEP, configure

from pnfarm.engine.channels.parts import Piece, Rider
from pnfarm.engine.channels.schedule import ChannelTable, ConsumerPlan, ProviderPlan
from pnfarm.engine.columns import allocate
from pnfarm.engine.virtual import run_virtual
from pnfarm.errors import InternalError
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP
from pnfarm.table.program import CONSTANT
from pnfarm.table.signals import NIST_A, NSOLL_A, STW1, ZSW1, word_code

AXES = 3
DRIVE = bytes.fromhex("020000000001")
CONTROLLER = bytes.fromhex("020000000002")
LENGTH = 40
SET_POINTS = [((word_code(STW1), at), (word_code(NSOLL_A), at + 2)) for at in (0, 5, 10)]
ACTUALS = [((word_code(ZSW1), at), (word_code(NIST_A), at + 2)) for at in (0, 5, 10)]
IOPS = [4, 9, 14]
#: Two submodules with plain data: four octets with their status behind them, one octet.
PIECES = [Piece(20, 0, 4, 24, 5), Piece(25, 4, 1, 26, 6)]


class Cell:
    """A station with three axes and plain data, and its controller: one channel each way."""

    def __init__(self):
        self.farm = allocate(images=AXES, axes=AXES, channels=8, plain=1, pieces=8)
        self.controller = allocate(images=AXES, programs=AXES, channels=8, plain=1, pieces=8)
        self.tables = ChannelTable(self.farm), ChannelTable(self.controller)
        self.inputs = ProvidedData(self.farm.provided, 0, 5, 2)
        self.outputs = ConsumedData(self.farm.consumed, 0, 5, 2)
        self.plc_outputs = ProvidedData(self.controller.provided, 0, 5, 2)
        self.plc_inputs = ConsumedData(self.controller.consumed, 0, 5, 2)
        self.now = 1_000_000_000
        for axis in self.farm.axis:
            configure(axis)
        for number, program in enumerate(self.controller.program):
            program.active, program.kind, program.enable = 1, CONSTANT, 1
            program.speed, program.velocity_step = 60.0 * (number + 1), VELOCITY_STEP
            program.acknowledge_after_ns = 100 * MS
        ends = [(1, DRIVE, CONTROLLER, ACTUALS, SET_POINTS), (1, CONTROLLER, DRIVE, SET_POINTS, ACTUALS)]
        for table, (port, own, peer, sent, received) in zip(self.tables, ends, strict=True):
            common = {"image": 0, "port": port, "data_length": LENGTH, "send_clock_factor": 32, "reduction_ratio": 1}
            riders = [Rider(i, received[i], [IOPS[i]]) for i in (1, 2)]
            table.open_consumer(
                ConsumerPlan(
                    destination=own, source=peer, frame_id=0x8001, data_hold_factor=3, words=received[0],
                    iops=IOPS[:1], riders=riders, pieces=PIECES, **common,
                )
            )  # fmt: skip
            table.open_provider(
                ProviderPlan(
                    destination=peer, source=own, frame_id=0x8001, words=sent[0], iops=IOPS[:1],
                    riders=[Rider(i, sent[i], [IOPS[i]]) for i in (1, 2)], pieces=PIECES, **common,
                )
            )  # fmt: skip

    def run(self, seconds):
        until = self.now + round(seconds * 1e9)
        while self.now < until:
            self.now = run_virtual(
                self.farm, self.controller,
                np.array([int.from_bytes(DRIVE, "big")]), np.array([1], np.int32),
                np.array([int.from_bytes(CONTROLLER, "big")]), np.array([1], np.int32), self.now, until,
            )  # fmt: skip

    def reach(self, speeds):
        """At these speeds within a second; no longer than needed, for the interpreter's sake."""
        end = self.now + 1_000_000_000
        while self.speeds != speeds and self.now < end:
            self.run(0.01)
        assert self.speeds == speeds

    @property
    def speeds(self):
        return [round(float(axis.motor.velocity)) for axis in self.farm.axis]


def test_three_axes_of_one_channel_run_at_speeds_of_their_own():
    cell = Cell()
    begin = cell.now
    cell.reach([60, 120, 180])
    cycles = (cell.now - begin) // 1_000_000
    assert [int(axis.drive.state) for axis in cell.farm.axis] == [4, 4, 4]
    assert int(cell.farm.image[2].frames) == int(cell.farm.image[0].frames) > cycles - 5
    assert cell.farm.cpm[0].received > cycles - 5


def test_a_fault_of_one_axis_leaves_the_others_running_and_is_acknowledged_alone():
    cell = Cell()
    cell.reach([60, 120, 180])
    cell.controller.program[1].acknowledge_after_ns = 10_000 * MS
    settings = cell.farm.axis[1].commands.settings
    settings.ring[0], settings.head = 1 | 529 << 8, 1
    cell.run(0.05)
    assert [int(axis.faults.code[0]) != 0 for axis in cell.farm.axis] == [False, True, False]
    assert cell.speeds[0] == 60
    assert cell.speeds[1] != 120
    assert cell.speeds[2] == 180
    cell.controller.program[1].acknowledge_after_ns = 100 * MS
    cell.reach([60, 120, 180])


def test_a_silent_controller_ends_the_set_points_of_every_axis():
    cell = Cell()
    cell.run(0.1)
    cell.controller.ppm[0].active = 0
    cell.run(0.05)
    assert [int(image.lost) for image in cell.farm.image] == [LOST_EXPIRED] * AXES
    assert [int(image.valid) for image in cell.farm.image] == [0] * AXES


def test_a_bad_status_stops_only_its_axis():
    cell = Cell()
    cell.run(0.1)
    cell.controller.image[1].good = 0
    cell.run(0.05)
    assert [int(image.valid) for image in cell.farm.image] == [1, 0, 1]
    assert int(cell.farm.image[1].lost) == LOST_STOP


def test_plain_data_go_both_ways_with_their_status():
    cell = Cell()
    cell.inputs.write({0: b"\1\2\3\4", 4: b"\x80"})
    cell.plc_outputs.write({0: b"abcd"})
    cell.run(0.02)
    assert cell.plc_inputs.read() == b"\1\2\3\4\x80"
    assert cell.outputs.read() == b"abcd\0"
    assert cell.outputs.good(0)
    cell.plc_outputs.set_good(0, good=False)
    cell.plc_outputs.write({0: b"wxyz", 4: b"!"})
    cell.run(0.02)
    assert cell.outputs.read() == b"abcd!", "what is bad is not taken"
    assert [cell.outputs.good(number) for number in (0, 1)] == [False, True]


def test_plain_data_keep_their_values_with_status_bad_when_the_frames_stop():
    cell = Cell()
    cell.plc_outputs.write({0: b"abcd"})
    cell.run(0.02)
    cell.controller.ppm[0].active = 0
    cell.run(0.05)
    assert cell.outputs.read() == b"abcd\0"
    assert not cell.outputs.good(0)


def test_closing_a_channel_closes_its_riders_and_frees_its_pieces():
    cell = Cell()
    cell.run(0.02)
    for _ in range(10):
        cell.tables[0].close_consumer(0)
        cell.run(0.002)
        assert [int(image.valid) for image in cell.farm.image] == [0] * AXES
        row = cell.tables[0].open_consumer(
            ConsumerPlan(
                destination=DRIVE, source=CONTROLLER, frame_id=0x8001, data_hold_factor=3, words=SET_POINTS[0],
                iops=IOPS[:1], riders=[Rider(i, SET_POINTS[i], [IOPS[i]]) for i in (1, 2)], pieces=PIECES,
                image=0, port=1, data_length=LENGTH, send_clock_factor=32, reduction_ratio=1,
            )
        )  # fmt: skip
        assert row == 0
    cell.run(0.05)
    assert [int(image.valid) for image in cell.farm.image] == [1] * AXES


def test_pieces_of_a_channel_that_ends_within_a_tick_stay_until_a_whole_one_has_passed():
    cell = Cell()
    cell.run(0.02)
    first, table = int(cell.farm.cpm[0].piece), cell.tables[0]
    table.close_consumer(0)
    # the end of a tick that looked at its row before
    cell.farm.engine[0].cycles += 1
    plan = ConsumerPlan(
        image=0, port=1, destination=DRIVE, source=CONTROLLER, frame_id=0x8002, data_length=LENGTH,
        send_clock_factor=32, reduction_ratio=1, data_hold_factor=3, words=(), iops=(), pieces=PIECES,
    )  # fmt: skip
    assert int(cell.farm.cpm[table.open_consumer(plan)].piece) != first
    cell.run(0.002)
    assert int(cell.farm.cpm[table.open_consumer(plan)].piece) == first


def test_a_new_layout_moves_words_and_plain_data_of_an_open_channel():
    cell = Cell()
    cell.plc_outputs.write({0: b"abcd", 4: b"e"})
    cell.run(0.02)
    only = [Piece(30, 4, 1, None, 6)]
    moved = [Rider(1, SET_POINTS[1], []), Rider(2, [], [], feeds=False)]
    cell.tables[1].relayout_provider(0, SET_POINTS[0], IOPS[:1], [], riders=moved, pieces=only)
    cell.tables[0].relayout_consumer(0, SET_POINTS[0], IOPS[:1], feeds=True, riders=moved, pieces=only)
    cell.plc_outputs.write({0: b"WXYZ", 4: b"!"})
    cell.run(0.05)
    assert cell.outputs.read() == b"abcd!"
    assert [int(image.valid) for image in cell.farm.image] == [1, 1, 0]
    assert cell.tables[0].consumed(0)[30:31] == b"!"
    assert cell.tables[1].provided(0)[20:27] == bytes(7), "what nothing carries is zero"


@pytest.mark.parametrize(
    "piece", [Piece(38, 0, 4, None, 5), Piece(0, 4095, 4, None, 5), Piece(0, 0, 4, 40, 5), Piece(0, 0, 4, 4, 4096)]
)
def test_a_piece_outside_of_frame_or_row_is_an_internal_error(piece):
    table = ChannelTable(allocate(images=1, channels=1, plain=1, pieces=4))
    with pytest.raises(InternalError, match="lies outside"):
        table.open_provider(
            ProviderPlan(
                image=0, port=1, destination=CONTROLLER, source=DRIVE, frame_id=0x8001, data_length=LENGTH,
                send_clock_factor=32, reduction_ratio=1, words=[], iops=[], pieces=[piece],
            )
        )  # fmt: skip


def test_nobody_sees_half_a_change_of_1400_octets_while_the_engine_runs():
    """A thread writes and reads beside the engine, which runs without the interpreter's lock."""
    length, octets = 1404, 1400
    piece = Piece(0, 0, octets, octets, octets)
    farm, plc = (allocate(images=1, channels=2, plain=1, pieces=2) for _ in range(2))
    common = {"image": 0, "port": 1, "data_length": length, "send_clock_factor": 8, "reduction_ratio": 1}
    ends = {"frame_id": 0x8001, "words": [], "iops": [], "pieces": [piece], **common}
    ChannelTable(plc).open_provider(ProviderPlan(destination=DRIVE, source=CONTROLLER, **ends))
    ChannelTable(farm).open_consumer(ConsumerPlan(destination=DRIVE, source=CONTROLLER, data_hold_factor=255, **ends))
    sent, taken = ProvidedData(plc.provided, 0, octets, 1), ConsumedData(farm.consumed, 0, octets, 1)
    torn, seen, over = [], set(), threading.Event()

    def beside():
        number = 0
        while not over.is_set():
            number = (number + 1) & 0xFF
            sent.write({0: bytes([number]) * octets})
            found = set(taken.read())
            seen.update(found)
            if len(found) > 1:
                torn.append(found)

    thread = threading.Thread(target=beside)
    thread.start()
    now = 1_000_000_000
    places = np.array([int.from_bytes(DRIVE, "big")]), np.array([1], np.int32)
    others = np.array([int.from_bytes(CONTROLLER, "big")]), np.array([1], np.int32)
    # octet by octet, the interpreter takes a second for a few cycles
    least, most = (6_000_000_000, 600_000_000_000) if IS_COMPILED else (1_050_000_000, 1_200_000_000)
    while now < least or (len(seen) <= 20 and now < most):
        now = run_virtual(farm, plc, *places, *others, now, now + 10_000_000)
    over.set()
    thread.join()
    assert torn == []
    assert len(seen) > (20 if IS_COMPILED else 2), "changes were seen while the engine ran"
