"""Drives and controller over an ideal wire in virtual time."""

import numpy as np
import pytest
from bench_axis import MS
from from_python import called
from virtual_pair import Pair

from pnfarm.engine.channels.impairments import ImpairmentTable
from pnfarm.engine.channels.schedule import ChannelTable, ProviderPlan
from pnfarm.engine.columns import allocate, lookup_find, lookup_rebuild
from pnfarm.engine.tick import receive
from pnfarm.errors import InternalError
from pnfarm.table.channel import (
    DISCARD_COUNTER,
    DISCARD_IMPAIRED,
    IOXS_BAD,
    IOXS_GOOD,
    MAX_WORDS,
    STATUS_RUN,
    STATUS_VALID,
)
from pnfarm.table.impairment import DATA_INVALID, DELAY, DUPLICATE, IOPS_BAD, LOSS, PROVIDER_STOP, THROTTLE
from pnfarm.table.program import FAULTED, RUNNING

ALWAYS = 0xFFFFFFFF


def impair(pair: Pair, table: str, row: int, kind: int, **values: int) -> np.record:
    """Link one impairment in front of a channel of the farm."""
    number = next(i for i in range(pair.farm.impairment.shape[0]) if pair.farm.impairment[i].kind == 0)
    entry = pair.farm.impairment[number]
    entry.kind, entry.threshold, entry.random = kind, ALWAYS, 88172645463325252
    for name, value in values.items():
        setattr(entry, name, value)
    getattr(pair.farm, table)[row].impairment = number + 1
    return entry


def test_a_controller_brings_a_drive_to_its_speed():
    pair = Pair(speed=600.0)
    pair.run(1.0)
    assert pair.farm.axis[0].drive.state == 4
    assert pair.controller.program[0].phase == RUNNING
    assert pair.farm.axis[0].motor.velocity == pytest.approx(600.0, abs=0.3)
    assert [value & 0xFF for _, value in pair.seen("state_changed")] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("factor", "ratio"), [(8, 1), (16, 1), (32, 1), (64, 2), (32, 16), (128, 4), (3, 1), (48, 1), (32, 512)]
)
def test_every_send_clock_and_reduction_ratio_keeps_its_period_exactly(factor, ratio):
    pair = Pair(drives=2, factor=factor, ratio=ratio, hold=8)
    pair.run(max(0.005, pair.cycle_ns * 2e-9))
    before = [int(pair.farm.ppm[row].sent) for row in range(2)]
    cycles = 20 if pair.cycle_ns < 100 * MS else 3
    pair.run(pair.cycle_ns * cycles / 1e9)
    assert [int(pair.farm.ppm[row].sent) - before[row] for row in range(2)] == [cycles, cycles]
    assert pair.farm.ppm.late.sum() == 0
    assert pair.farm.cpm.discarded.sum() == 0
    assert pair.farm.cpm[0].received >= cycles


def test_cycle_counter_advances_by_factor_times_ratio():
    pair = Pair(factor=32, ratio=4)
    pair.run(0.1)
    before = int(pair.farm.ppm[0].counter)
    pair.run(0.004)
    assert (int(pair.farm.ppm[0].counter) - before) & 0xFFFF == 128


def test_phases_spread_the_frames_of_one_cycle_over_its_send_clocks():
    pair = Pair(drives=16, factor=32, ratio=16)
    pair.run(0.1)
    due = {int(pair.farm.ppm[i].next_ns) % (16 * MS) for i in range(16)}
    assert due == {i * MS for i in range(16)}


def test_data_hold_time_expires_once_and_raises_702():
    pair = Pair(hold=3)
    pair.run(0.5)
    pair.controller.ppm[0].active = 0
    pair.run(0.1)
    assert len(pair.seen("expired")) == 1
    assert pair.seen("fault_raised") == [(0, 702)]
    ((_, silent_ns),) = pair.seen("expired")
    assert 3 * MS < silent_ns <= 5 * MS


def test_a_controller_that_comes_back_is_reported_as_a_first_frame_and_recovers_the_drive():
    pair = Pair()
    pair.run(0.5)
    pair.controller.ppm[0].active = 0
    pair.run(0.1)
    pair.controller.ppm[0].active = 1
    pair.run(1.0)
    assert len(pair.seen("first_frame")) == 2
    assert pair.farm.axis[0].drive.state == 4
    assert pair.farm.axis[0].faults.code[0] == 0


def test_a_fault_is_seen_and_acknowledged_and_its_reaction_time_reported():
    pair = Pair()
    pair.run(0.5)
    axis = pair.farm.axis[0]
    axis.commands.settings.ring[0], axis.commands.settings.head = 1 | 529 << 8, 1
    pair.run(0.02)
    assert pair.controller.program[0].phase == FAULTED
    pair.run(1.0)
    ((_, reaction),) = pair.seen("fault_reacted")
    assert 0 < reaction <= 4 * MS
    program = pair.controller.program[0]
    assert program.phase == RUNNING
    assert program.faults == 1
    # the drive answers a control word within two cycles; the program waits 100 ms before it acknowledges
    assert 0 < program.reaction_ns <= 3 * MS
    assert 100 * MS < program.recovery_ns < 150 * MS


def test_loss_drops_received_frames_with_its_probability_and_counts_evidence():
    pair = Pair(hold=64)
    pair.run(0.1)
    entry = impair(pair, "cpm", 0, LOSS, threshold=int(0.25 * 2**32))
    pair.run(4.0)
    assert entry.checks == pytest.approx(4000, abs=2)
    assert entry.activations == pytest.approx(1000, rel=0.15)
    assert pair.farm.cpm[0].discarded[4] == entry.activations


def test_the_same_seed_loses_the_same_frames():
    def lost() -> list[int]:
        pair = Pair(hold=64)
        impair(pair, "cpm", 0, LOSS, threshold=1 << 30)
        marks = []
        for _ in range(100):
            pair.run(0.001)
            marks.append(int(pair.farm.cpm[0].discarded[4]))
        return marks

    first = lost()
    assert first[-1] > 0
    assert first == lost()


@pytest.mark.parametrize("direction", ["in", "out"])
def test_frames_that_a_delay_holds_come_before_the_next_one_when_it_ends(direction):
    # a frame in each tick: also in the one that lets them go on
    pair = Pair(hold=64)
    pair.run(0.1)
    table = ImpairmentTable(pair.farm)
    table.channel_opened(0, direction, 0)
    delay = table.add(0, direction, DELAY, settings={"delay_ns": 5 * MS})
    pair.run(0.05)
    receiver = pair.farm.cpm[0] if direction == "in" else pair.controller.cpm[0]
    before = int(receiver.received)
    assert table.waiting(delay) >= 4
    table.remove(delay)
    pair.run(0.01)
    assert int(receiver.received) - before >= 14
    assert receiver.discarded[DISCARD_COUNTER] == 0


@pytest.mark.parametrize("follower", [True, False])
def test_a_frame_that_waited_longer_than_its_connection_lived_is_not_taken(follower):
    pair = Pair(hold=64)
    pair.run(0.1)
    table = ImpairmentTable(pair.farm)
    table.channel_opened(0, "in", 0)
    table.add(0, "in", DELAY, settings={"delay_ns": 30 * MS})
    pair.run(0.02)
    assert pair.farm.engine[0].held_in >= 19
    consumer = pair.farm.cpm[0]
    before = int(consumer.received)
    if follower:
        # the row is another connection's
        consumer.generation += 1
    else:
        pair.farm_channels.close_consumer(0)
    pair.run(0.029)
    assert consumer.received == before
    pair.run(0.01)
    assert bool(consumer.received > before) is follower


@pytest.mark.parametrize("runs", [0, 1])
@pytest.mark.parametrize("good", [0, 1])
def test_the_first_frame_reports_what_its_provider_is_whatever_the_row_held_before(good, runs):
    pair = Pair()
    sender, receiver = pair.controller.ppm[0], pair.farm.cpm[0]
    receiver.iops, receiver.data_status = (IOXS_GOOD if good else IOXS_BAD), (STATUS_RUN if runs else 0)
    sender.data_status = STATUS_VALID | (STATUS_RUN if runs else 0)
    pair.controller.image[0].good = good
    pair.run(0.05)
    assert pair.seen("first_frame") == [(0, int(receiver.generation))]
    assert pair.seen("provider_changed") == [(0, runs)]
    assert pair.seen("iops_changed") == [(0, good)]
    assert bool(pair.farm.image[0].valid) is bool(good and runs)


def test_data_that_have_not_come_yet_do_not_expire_where_their_first_has_no_limit():
    pair = Pair()
    pair.controller.ppm[0].active = 0
    pair.run(0.5)
    assert pair.farm.cpm[0].first_hold_ns == 0
    assert pair.seen("expired") == []
    assert pair.farm.cpm[0].expirations == 0


@pytest.mark.parametrize("direction", ["in", "out"])
def test_a_frame_behind_the_end_of_a_slow_line_does_not_overtake_those_that_wait_there(direction):
    pair = Pair(hold=64)
    pair.run(0.1)
    table = ImpairmentTable(pair.farm)
    table.channel_opened(0, direction, 0)
    # 64 octets and 24 on the line: 2.2 ms for each frame of 1 ms
    slow = {"octet_ns": 25_000.0, "delay_ns": 100 * MS}
    table.add(0, direction, THROTTLE, stop_ns=pair.now + 20 * MS, settings=slow)
    pair.run(0.1)
    receiver = pair.farm.cpm[0] if direction == "in" else pair.controller.cpm[0]
    assert receiver.discarded[DISCARD_COUNTER] == 0


@pytest.mark.parametrize("direction", ["in", "out"])
def test_a_frame_that_waits_is_not_counted_as_lost_where_only_its_copies_find_no_room(direction):
    pair = Pair(hold=200)
    pair.run(0.1)
    table = ImpairmentTable(pair.farm)
    table.channel_opened(0, direction, 0)
    table.add(0, direction, DELAY, settings={"delay_ns": 500 * MS})
    pair.run(0.05)
    engine = pair.farm.engine[0]
    waiting = int(engine.held_in if direction == "in" else engine.held_out)
    table.add(0, direction, DUPLICATE, count=1, settings={"amount": pair.farm.held_order.shape[1] - waiting})
    pair.run(0.001)
    lost = pair.farm.cpm[0].discarded[DISCARD_IMPAIRED] if direction == "in" else pair.farm.ppm[0].suppressed
    assert lost == 0


def test_provider_stop_reaches_the_controller_within_one_cycle_and_clears_with_it():
    pair = Pair()
    pair.run(0.5)
    impair(pair, "ppm", 0, PROVIDER_STOP)
    pair.run(0.002)
    assert pair.seen("provider_changed", "controller")[-1] == (0, 0)
    assert not pair.controller.image[0].valid
    pair.farm.ppm[0].impairment = 0
    pair.run(0.002)
    assert pair.seen("provider_changed", "controller")[-1] == (0, 1)


def test_bad_iops_reaches_the_controller_within_one_cycle():
    pair = Pair()
    pair.run(0.5)
    impair(pair, "ppm", 0, IOPS_BAD, limit=5)
    pair.run(0.002)
    assert pair.seen("iops_changed", "controller")[-1] == (0, 0)
    pair.run(0.1)
    assert pair.seen("iops_changed", "controller")[-1] == (0, 1)


def test_invalid_data_is_discarded_by_the_consumer():
    pair = Pair(hold=64)
    pair.run(0.5)
    impair(pair, "ppm", 0, DATA_INVALID, limit=7)
    pair.run(0.1)
    assert pair.controller.cpm[0].discarded[3] == 7


def test_impairment_waits_for_its_healthy_frames_and_its_time_window():
    pair = Pair()
    pair.run(0.1)
    entry = impair(pair, "ppm", 0, LOSS, after=10, limit=3, start_ns=pair.now + 50 * MS)
    pair.run(0.04)
    assert entry.checks == 0
    pair.run(0.1)
    assert entry.activations == 3
    assert entry.first_ns >= pair.now - 100 * MS
    assert pair.farm.ppm[0].suppressed == 3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"length": 63}, 0),
        ({"length": 65}, 0),
        ({11: 0x77}, 1),
    ],
)
def test_a_frame_that_is_not_as_agreed_is_counted_and_dropped(change, reason):
    pair = Pair(hold=64)
    pair.run(0.1)
    for key, value in change.items():
        if key == "length":
            pair.controller.ppm[0].length = value
        else:
            pair.controller.frames[0][key] = value
    pair.run(0.01)
    assert pair.farm.cpm[0].discarded[reason] == 10


def test_frames_without_a_consumer_are_counted_as_unknown_and_for_the_station_of_their_port():
    pair = Pair()
    pair.farm.image[0].port, pair.farm.image[0].mac = pair.farm.cpm[0].port, pair.farm.cpm[0].destination
    pair.run(0.1)
    pair.controller.frames[0][18] = 0xC1
    pair.run(0.01)
    assert pair.farm.engine[0].unknown == 10
    assert pair.farm.image[0].strays == 10


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, None),
        ({14: 0xCF, 15: 0xFE}, None),  # VLAN 4094
        ({63: 0x01}, "transfer-status"),
        ({0: 0xFF}, "stray"),
        ({0: 0x01}, "stray"),
        ({5: 0x77}, "of another"),
    ],
)
def test_a_frame_of_any_vlan_is_taken_unless_it_has_a_transfer_status_or_is_not_for_this_station(change, reason):
    pair = Pair(hold=64)
    pair.farm.image[0].port, pair.farm.image[0].mac = pair.farm.cpm[0].port, pair.farm.cpm[0].destination
    pair.run(0.1)
    farm = pair.farm
    farm.rx_frames[0][:64] = pair.controller.frames[0][:64]
    farm.rx_frames[0][61] += 32
    for place, octet in change.items():
        farm.rx_frames[0][place] = octet
    farm.rx_length[0], farm.rx_port[0], farm.rx_ns[0] = 64, farm.cpm[0].port, pair.now
    before, unknown = int(farm.cpm[0].received), int(farm.engine[0].unknown)
    receive(farm, 1)
    assert int(farm.cpm[0].received) == before + (reason is None)
    assert int(farm.cpm[0].discarded[5]) == (reason == "transfer-status")
    assert int(farm.engine[0].unknown) - unknown == (reason in {"stray", "of another"})
    assert int(farm.image[0].strays) == (reason == "stray")


def test_a_repeated_cycle_counter_is_an_old_frame():
    pair = Pair(hold=64)
    pair.run(0.1)
    pair.controller.ppm[0].counter_step = 0
    pair.run(0.01)
    assert pair.farm.cpm[0].discarded[2] >= 9


def test_a_closed_row_is_not_handed_out_before_the_engine_has_seen_it():
    columns = allocate(images=1, axes=0, channels=2)
    channels = ChannelTable(columns)
    plan = ProviderPlan(
        image=0, port=1, destination=bytes(6), source=bytes(6), frame_id=0x8000, data_length=40,
        send_clock_factor=32, reduction_ratio=1, words=[(0, 0)], iops=[2],
    )  # fmt: skip
    first = channels.open_provider(plan)
    columns.ppm[first].state = 3
    channels.close_provider(first)
    assert channels.open_provider(plan) != first


def test_a_full_table_says_so():
    columns = allocate(images=1, channels=1)
    channels = ChannelTable(columns)
    plan = ProviderPlan(
        image=0, port=1, destination=bytes(6), source=bytes(6), frame_id=0x8000, data_length=40,
        send_clock_factor=32, reduction_ratio=1, words=[], iops=[],
    )  # fmt: skip
    channels.open_provider(plan)
    with pytest.raises(InternalError, match="all 1 rows of the ppm table"):
        channels.open_provider(plan)


@pytest.mark.parametrize(
    ("words", "iops"),
    [([(0, 39)], [4]), ([(0, -1)], [4]), ([(0, 0)], [40]), ([(0, 0)] * (MAX_WORDS + 1), [4]), ([(0, 0)], [1] * 5)],
)
def test_offsets_outside_of_the_data_are_refused_before_compiled_code_sees_them(words, iops):
    channels = ChannelTable(allocate(images=1, channels=1))
    with pytest.raises(InternalError):
        channels.open_provider(
            ProviderPlan(
                image=0, port=1, destination=bytes(6), source=bytes(6), frame_id=0x8000, data_length=40,
                send_clock_factor=32, reduction_ratio=1, words=words, iops=iops,
            )
        )  # fmt: skip


def test_lookup_finds_every_consumer_by_port_and_frame_id_and_nothing_else():
    columns = allocate(images=1, channels=300)
    columns.engine[0].cpm_rows = 300
    for i in range(300):
        columns.cpm[i].active, columns.cpm[i].port, columns.cpm[i].frame_id = 1, 7 + i % 5, 0x8000 + i // 5
    lookup_rebuild(columns)
    table = columns.lookup[columns.engine[0].lookup]
    find = called(lookup_find)
    assert [find(table, columns.cpm, 7 + i % 5, 0x8000 + i // 5, 0) for i in range(300)] == list(range(300))
    assert called(lookup_find)(table, columns.cpm, 12, 0x8000, 0) == -1
    assert called(lookup_find)(table, columns.cpm, 7, 0x8000, 1) == -1
    columns.cpm[5].active = 0
    assert called(lookup_find)(table, columns.cpm, 7, 0x8001, 0) == -1


def test_two_multicasts_of_one_id_are_told_apart_by_their_groups():
    columns = allocate(images=1, channels=4)
    columns.engine[0].cpm_rows = 2
    for i in range(2):
        columns.cpm[i].active, columns.cpm[i].port, columns.cpm[i].frame_id = 1, 7, 0x10001
        columns.cpm[i].destination = 0x01005E400220 + i
    lookup_rebuild(columns)
    table = columns.lookup[columns.engine[0].lookup]
    assert [called(lookup_find)(table, columns.cpm, 7, 0x10001, 0x01005E400220 + i) for i in range(3)] == [0, 1, -1]
