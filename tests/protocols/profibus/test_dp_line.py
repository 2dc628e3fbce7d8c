"""A master and its slaves: start-up, loss and return, watchdogs, diagnosis, control, records."""

from dataclasses import replace

import pytest
from dp_line import IDENT, MS, DpLine

from pnfarm.protocols.profibus.master_slaves import ConnectionMade, ConnectionMissed, DiagnosisRead, SlaveState
from pnfarm.protocols.profibus.record_request import RecordRequest
from pnfarm.protocols.profibus.slave_user import AcyclicClosed, ExchangeBegan, Left, ParametersTaken
from pnfarm.protocols.profibus.wire.dp import Control, DpState, Parameters, PrmStatus, StationStatus
from pnfarm.protocols.profibus.wire.dpv1 import Function
from pnfarm.protocols.profibus.wire.telegram import Sap, ShortAck, Telegram, parse_telegram


@pytest.mark.parametrize("count", [1, 8, 32])
def test_slaves_come_into_data_exchange_and_are_polled(count):
    line = DpLine(count)
    assert line.run(1.0, until=lambda: line.exchanging)
    line.master.station("s0").outputs = b"\x04\x7f" + bytes(10)
    line.run(0.1)
    assert line.drives[0].outputs[-1] == b"\x04\x7f" + bytes(10)
    assert all(station.inputs == bytes(range(12)) for station in line.master.stations)
    assert [type(event) for event in line.events] == [ConnectionMade] * count
    kinds = [type(event) for event in line.slaves[0].take_events()]
    assert ParametersTaken in kinds
    assert ExchangeBegan in kinds


def test_a_cycle_takes_the_time_that_was_asked_for_where_the_line_permits_it():
    line = DpLine(1, cycle_ns=5 * MS)
    line.run(0.2)
    polls = line.master.stations[0].polls
    line.run(1.0)
    assert line.master.stations[0].polls - polls == pytest.approx(200, abs=2)
    fast = DpLine(32, cycle_ns=100_000)
    fast.run(1.0, until=lambda: fast.exchanging)
    fast.run(1.0)
    # 21 octets and 21 back at 1.5 Mbit/s, the pauses between: some 0.37 ms for each slave
    assert fast.master.cycle_ns == pytest.approx(32 * 370_000, rel=0.2)


def test_a_slave_that_falls_silent_is_lost_and_comes_back():
    line = DpLine(2)
    line.run(1.0, until=lambda: line.exchanging)
    cut = [True]

    def lose(who, octets):
        """The plug of the first slave is out."""
        telegram = parse_telegram(octets)
        mine = isinstance(telegram, ShortAck) or 3 in {telegram.destination, telegram.source}
        return None if cut[0] and mine else octets

    line.lose = lose
    assert line.run(1.0, until=lambda: line.master.stations[0].state is SlaveState.WAITING)
    assert line.master.stations[0].reason == "no answer"
    assert line.master.counts["retries"] >= 1
    # it hears the master no more, so its watchdog runs out, and its outputs are taken back
    assert line.run(1.0, until=lambda: line.slaves[0].state is DpState.WAIT_PRM)
    left = [event for event in line.slaves[0].take_events() if isinstance(event, Left)]
    assert (left[0].why, left[0].before, left[0].exchanged) == ("watchdog", DpState.DATA_EXCH, True)
    assert line.master.stations[1].exchanging
    cut[0] = False
    assert line.run(2.0, until=lambda: line.exchanging)
    assert line.master.stations[0].connects == 2
    assert line.master.stations[1].connects == 1


def _unplugged(line, cut):
    line.lose = lambda _who, octets: None if cut[0] else octets


def test_without_reconnect_a_lost_slave_stays_lost_and_requests_for_its_records_fail_at_once():
    line, cut = DpLine(1), [False]
    line.plans[0] = line.master.stations[0].plan = replace(line.plans[0], reconnect_ns=None)
    _unplugged(line, cut)
    assert line.run(1.0, until=lambda: line.exchanging)
    cut[0] = True
    assert line.run(1.0, until=lambda: line.master.all_stopped)
    cut[0] = False
    asked = RecordRequest.read(0, 47, 10)
    line.master.ask("s0", asked, line.now)
    assert (asked.done, asked.error) == (True, "no answer")
    assert line.master.next_deadline() is None


def test_without_reconnect_a_slave_that_was_never_there_is_still_awaited():
    line, cut = DpLine(1), [True]
    line.plans[0] = line.master.stations[0].plan = replace(line.plans[0], reconnect_ns=None)
    _unplugged(line, cut)
    assert not line.run(3.0, until=lambda: line.exchanging)
    cut[0] = False
    assert line.run(2.0, until=lambda: line.exchanging)


def test_one_lost_answer_is_repeated_with_the_same_fcb_and_counts_once_for_the_slave():
    line = DpLine(1)
    line.run(1.0, until=lambda: line.exchanging)
    lost = []

    def lose(who, octets):
        if who == "slave" and not lost:
            lost.append(octets)
            return None
        return octets

    before = len(line.drives[0].outputs)
    polls = line.master.stations[0].polls
    line.lose = lose
    line.run(0.1)
    assert lost
    assert line.slaves[0].repeated == 1
    assert line.master.stations[0].retries == 1
    assert len(line.drives[0].outputs) - before == line.master.stations[0].polls - polls, "taken once"
    assert line.exchanging


def test_the_second_answer_to_a_repeated_poll_is_not_taken_for_a_diagnosis():
    line = DpLine(1)
    line.run(1.0, until=lambda: line.exchanging)
    polled = []

    def lose(who, octets):
        telegram = parse_telegram(octets)
        if who == "slave" and telegram.ssap is None:
            polled.append(telegram)
        elif who == "slave" and telegram.ssap == Sap.SLAVE_DIAGNOSIS:
            # the answer of before comes again, ahead of the diagnosis
            line.master.receive(polled[-1], line.now)
        return octets

    line.lose = lose
    line.drives[0].error = True
    line.slaves[0].diagnosis_changed()
    line.run(0.1)
    assert line.master.stations[0].losses == 0, line.master.stations[0].reason
    told = [event.diagnosis.ident for event in line.events if isinstance(event, DiagnosisRead)]
    assert told == [IDENT]


@pytest.mark.parametrize(("factors", "base", "milliseconds"), [((10, 1), 0, 100), ((5, 7), 4, 35), ((0, 0), 0, None)])
def test_the_watchdog_has_the_time_of_its_factors(factors, base, milliseconds):
    line = DpLine(1, watchdog=factors if milliseconds else None)
    line.plans[0] = line.master.stations[0].plan
    object.__setattr__(line.master.stations[0].plan, "user", bytes((0x80 | base, 0, 0)))
    line.run(1.0, until=lambda: line.exchanging)
    slave = line.slaves[0]
    assert slave.watchdog_ns == (milliseconds or 0) * MS
    slave.take_events()
    quiet = line.now
    line.lose = lambda who, octets: None if who == "master" else octets
    line.run(2.0, until=lambda: slave.state is not DpState.DATA_EXCH)
    if milliseconds is None:
        assert slave.state is DpState.DATA_EXCH
    else:
        assert line.now - quiet == pytest.approx(milliseconds * MS, abs=3 * MS)


def test_what_does_not_fit_is_said_by_the_diagnosis_and_tried_again():
    line = DpLine(1)
    line.slaves[0].options.ident = IDENT + 1
    line.run(0.5)
    assert "ident number 0x0BAE instead of 0x0BAD" in line.master.stations[0].reason
    line.slaves[0].options.ident = IDENT
    line.slaves[0].refuse_parameters = "no"
    line.run(0.5)
    assert "Prm_Fault" in line.master.stations[0].reason
    line.slaves[0].refuse_parameters = None
    line.slaves[0].refuse_configuration = True
    line.run(0.5)
    assert "Cfg_Fault" in line.master.stations[0].reason
    line.slaves[0].refuse_configuration = False
    assert line.run(1.0, until=lambda: line.exchanging)
    assert sum(isinstance(event, ConnectionMissed) for event in line.events) == 3, "each reason once"


def test_a_slave_of_another_master_is_left_alone_and_taken_once_it_is_free():
    line = DpLine(1)
    slave, plan = line.slaves[0], line.plans[0]

    def other(status):
        octets = Parameters(status, (0, 0), 11, IDENT).emit()
        slave.receive(Telegram(plan.address, 9, 0x6D, Sap.SET_PARAMETERS, Sap.MASTER, octets), line.now)

    other(PrmStatus.LOCK_REQ)
    line.run(0.5)
    station = line.master.stations[0]
    assert station.reason == "master 9 has it"
    assert station.diagnosis.status & StationStatus.MASTER_LOCK, "set by the master that read it"
    assert not any(isinstance(one, Telegram) and one.dsap == Sap.SET_PARAMETERS for one in line.seen)
    other(PrmStatus.UNLOCK_REQ)
    assert line.run(1.0, until=lambda: line.exchanging)
    assert not station.diagnosis.status & StationStatus.MASTER_LOCK


def test_a_diagnosis_in_data_exchange_is_fetched_once_and_a_static_one_again_and_again_and_each_is_told_once():
    line = DpLine(1)
    line.run(1.0, until=lambda: line.exchanging)
    drive, slave = line.drives[0], line.slaves[0]
    drive.error, drive.extended = True, bytes((4, 0x81, 0, 0))
    slave.diagnosis_changed()
    line.run(0.2)
    read = [event for event in line.events if isinstance(event, DiagnosisRead)]
    assert len(read) == 1
    assert read[0].diagnosis.status & StationStatus.EXT_DIAG
    assert read[0].diagnosis.extended == drive.extended
    assert line.exchanging
    drive.static, fetched = True, slave.diagnoses
    slave.diagnosis_changed()
    line.run(0.1)
    assert slave.diagnoses > fetched + 5
    drive.static = False
    line.run(0.1)
    fetched = slave.diagnoses
    line.run(0.1)
    assert slave.diagnoses == fetched
    read = [event.diagnosis.status for event in line.events if isinstance(event, DiagnosisRead)]
    assert [bool(status & StationStatus.STAT_DIAG) for status in read] == [False, True, False]


def test_the_diagnosis_of_a_slave_without_inputs_is_read_and_data_exchange_goes_on():
    line = DpLine(1)
    station, drive = line.master.stations[0], line.drives[0]
    station.plan = replace(station.plan, input_octets=0)
    drive.inputs = lambda: b""
    assert line.run(1.0, until=lambda: line.exchanging)
    line.events.clear()
    drive.error, drive.extended = True, b"\x02\x01"
    line.slaves[0].diagnosis_changed()
    line.run(0.2)
    assert [(type(event), getattr(event, "why", "")) for event in line.events] == [(DiagnosisRead, "")]
    assert (station.losses, station.connects) == (0, 1)


def test_clear_makes_outputs_zero_until_operate():
    line = DpLine(2)
    line.run(1.0, until=lambda: line.exchanging)
    line.master.control(Control.CLEAR_DATA)
    line.run(0.05)
    assert all(slave.clear for slave in line.slaves)
    taken = len(line.drives[0].outputs)
    line.run(0.05)
    assert len(line.drives[0].outputs) == taken
    assert line.drives[0].cleared > 5
    line.master.control(0)
    line.run(0.05)
    assert not any(slave.clear for slave in line.slaves)
    assert len(line.drives[0].outputs) > taken


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_records_are_written_and_read_back_while_data_are_exchanged(access):
    line = DpLine(2, access=access)
    line.run(1.0, until=lambda: line.exchanging)
    data = bytes(range(100))
    write, read = RecordRequest.write(0, 47, data), RecordRequest.read(0, 47, 240)
    line.drives[0].ready_ns = line.now + 20 * MS
    line.master.ask("s0", write, line.now)
    line.master.ask("s0", read, line.now)
    assert line.run(1.0, until=lambda: write.done and read.done)
    assert (write.ok, read.ok, read.data) == (True, True, data)
    assert line.exchanging
    assert line.slaves[0].class_two.open == ([] if access == "class-1" else [(1, 0)])
    line.drives[0].refuse = (0xB0, 1)
    again = RecordRequest.read(0, 48, 10)
    line.master.ask("s0", again, line.now)
    assert line.run(1.0, until=lambda: again.done)
    assert again.refused == (0xB0, 1)
    # a quiet connection of class 2 is kept alive by idle telegrams
    line.run(5.0)
    assert line.slaves[0].class_two.open == ([] if access == "class-1" else [(1, 0)])


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_after_a_request_that_got_no_answer_in_time_the_next_ones_get_theirs(access):
    line = DpLine(1, access=access)
    line.run(1.0, until=lambda: line.exchanging)
    line.drives[0].records[0, 47] = b"hello"
    line.drives[0].ready_ns = line.now + 6_000 * MS
    late = RecordRequest.read(0, 46, 10)
    line.master.ask("s0", late, line.now)
    assert line.run(6.0, until=lambda: late.done)
    assert late.error == "no answer in time"
    for wait in (0.0, 2.0):
        line.run(wait)
        read = RecordRequest.read(0, 47, 10)
        line.master.ask("s0", read, line.now)
        assert line.run(6.0, until=lambda read=read: read.done)
        assert (read.error, read.data) == ("", b"hello")


def test_a_request_beside_an_idle_telegram_is_answered_in_the_same_connection():
    line = DpLine(1, access="class-2")
    line.run(1.0, until=lambda: line.exchanging)
    for offset in range(40):
        # an Idle is due half a second behind the last telegram, and its answer is fetched by a poll of its own
        line.run(0.48 + offset / 1000)
        read = RecordRequest.read(0, 47, 10)
        line.master.ask("s0", read, line.now)
        assert line.run(1.0, until=lambda read=read: read.done)
        assert read.ok, f"asked {480 + offset} ms later: {read.error}"
    ended = [event for event in line.slaves[0].take_events() if isinstance(event, AcyclicClosed)]
    assert (ended, line.slaves[0].class_two.open) == ([], [(1, 0)])


def test_a_slave_that_does_not_answer_an_idle_telegram_is_connected_anew():
    line = DpLine(1, access="class-2")
    line.run(1.0, until=lambda: line.exchanging)
    slave = line.slaves[0].class_two
    take, deaf = slave._take, [True]
    slave._take = lambda data, *rest: None if deaf[0] and data[0] == Function.IDLE else take(data, *rest)
    for _ in range(2):
        read = RecordRequest.read(0, 47, 10)
        line.master.ask("s0", read, line.now)
        assert line.run(10.0, until=lambda read=read: read.done)
        assert read.ok, read.error
        line.run(10.0)
    deaf[0] = False
    assert len(slave.open) <= 1, "those that it was deaf in have ended"


def test_a_connection_of_a_lost_master_ends_by_time():
    line = DpLine(1)
    line.run(1.0, until=lambda: line.exchanging)
    read = RecordRequest.read(0, 47, 10)
    line.master.ask("s0", read, line.now)
    line.run(1.0, until=lambda: read.done)
    assert line.slaves[0].class_two.open
    line.lose = lambda who, octets: None
    line.run(10.0)
    assert not line.slaves[0].class_two.open
    assert line.drives[0].gone.count(1) == 1


def test_released_slaves_wait_for_parameters():
    line = DpLine(3)
    line.run(1.0, until=lambda: line.exchanging)
    line.master.release()
    assert line.run(0.5, until=lambda: line.master.all_stopped)
    assert {slave.state for slave in line.slaves} == {DpState.WAIT_PRM}
    left = [event for event in line.slaves[0].take_events() if isinstance(event, Left)]
    assert left[-1].why == "unlocked"


@pytest.mark.parametrize("request_of", ["poll", "parameters", "diagnosis"])
def test_a_slave_whose_answer_was_under_way_when_the_release_began_is_released_as_well(request_of):
    """The master is asked to stop at any time, mostly while it waits for an answer."""
    line = DpLine(2)
    sap = {"poll": None, "parameters": Sap.SET_PARAMETERS, "diagnosis": Sap.SLAVE_DIAGNOSIS}[request_of]
    released = []

    def release(who, octets):
        telegram = parse_telegram(octets)
        if who == "master" and telegram.destination == 3 and telegram.dsap == sap and not released:
            released.append(telegram)
            line.master.release()
        return octets

    line.lose = release
    assert line.run(1.0, until=lambda: bool(released) and line.master.all_stopped)
    assert [slave.state for slave in line.slaves] == [DpState.WAIT_PRM] * 2
    line.run(0.5)
    assert line.master.all_stopped
    assert "watchdog" not in {event.why for event in line.slaves[0].take_events() if isinstance(event, Left)}


def _silent(line, addresses):
    """The slaves with these addresses are off."""

    def lose(_who, octets):
        telegram = parse_telegram(octets)
        named = isinstance(telegram, Telegram) and addresses & {telegram.destination, telegram.source}
        return None if named else octets

    line.lose = lose


def test_slaves_that_are_not_there_take_little_of_the_time_of_the_others():
    line = DpLine(9, latency_ns=20 * MS)
    absent = set(range(3, 11))
    _silent(line, absent)
    there = line.master.stations[-1]
    assert line.run(5.0, until=lambda: there.exchanging)
    line.run(5.0)
    assert (there.connects, there.losses) == (1, 0)
    assert all(station.retries > 5 for station in line.master.stations[:-1])
    # one of them in a cycle, twice: its watchdog of 100 ms is far
    assert line.slaves[-1].state is DpState.DATA_EXCH
    polls = there.polls
    line.run(1.0)
    assert there.polls - polls > 20
    absent.clear()
    assert line.run(2.0, until=lambda: line.exchanging)


def test_when_several_slaves_fall_silent_at_once_the_others_are_not_kept_waiting_for_repetitions():
    line = DpLine(5, latency_ns=14 * MS)
    line.run(1.0, until=lambda: line.exchanging)
    _silent(line, set(range(3, 7)))
    line.run(1.0)
    assert [station.exchanging for station in line.master.stations] == [False] * 4 + [True]
    assert line.master.stations[-1].losses == 0
    assert all(station.reason == "no answer" for station in line.master.stations[:-1])


def test_slaves_whose_requests_wait_to_be_repeated_are_released_as_well():
    line = DpLine(3, latency_ns=20 * MS)
    line.run(1.0, until=lambda: line.exchanging)
    _silent(line, {3, 4})
    assert line.run(1.0, until=lambda: line.master._again)
    line.master.release()
    assert line.run(2.0, until=lambda: line.master.all_stopped)
    assert line.master.next_deadline() is None
