"""One slave, telegram by telegram: what it answers in each state, what it withholds, and what it never does."""

import pytest
from dp_line import IDENT, MS, DpLine, Drive
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from pnfarm.protocols.profibus.slave import PARAMETERS_AGAIN, TRANSITIONS, Slave
from pnfarm.protocols.profibus.slave_user import (
    AddressSet,
    BaudFound,
    BaudLost,
    ClearChanged,
    Left,
    ParametersRefused,
    SlaveOptions,
)
from pnfarm.protocols.profibus.wire.dp import (
    NO_MASTER,
    Control,
    Diagnosis,
    DpState,
    GlobalControl,
    Parameters,
    PrmStatus,
    SetAddress,
    StationStatus,
)
from pnfarm.protocols.profibus.wire.dpv1 import Access, Function, Initiate
from pnfarm.protocols.profibus.wire.telegram import (
    BROADCAST,
    Answer,
    Sap,
    ShortAck,
    Telegram,
    Token,
    emit_telegram,
    parse_telegram,
)

SRD, SDN, SDA, STATUS = 0x6D, 0x46, 0x45, 0x49
LOCK = PrmStatus.LOCK_REQ | PrmStatus.WD_ON | PrmStatus.SYNC_REQ | PrmStatus.FREEZE_REQ
DATA = b"\x04\x7f" + bytes(10)


class Bench:
    """A slave at address 3; ``ask`` is a fresh request of master 2."""

    def __init__(self, **options):
        self.drive = Drive()
        self.slave = Slave(3, self.drive, SlaveOptions(IDENT, **options))
        self.now = MS

    def ask(self, dsap=None, data=b"", *, ssap=Sap.MASTER, source=2, function=SRD):
        return self.slave.receive(Telegram(3, source, function, dsap, None if dsap is None else ssap, data), self.now)

    def parameters(self, status=LOCK, *, factors=(10, 1), ident=IDENT, group=1, user=b"\x80\x00\x00", tsdr=11):
        octets = Parameters(status, factors, tsdr, ident, group, user).emit()
        return self.ask(Sap.SET_PARAMETERS, octets)

    def exchange(self, *, data=DATA):
        assert self.parameters() == ShortAck()
        assert self.ask(Sap.CHECK_CONFIGURATION, self.drive.identifiers) == ShortAck()
        answer = self.ask(None, data)
        assert self.slave.state is DpState.DATA_EXCH
        return answer

    def diagnosis(self, source=2):
        answer = self.ask(Sap.SLAVE_DIAGNOSIS, source=source)
        assert (answer.dsap, answer.ssap) == (Sap.MASTER, Sap.SLAVE_DIAGNOSIS)
        return Diagnosis.parse(answer.data)


@pytest.fixture
def bench():
    return Bench()


def test_a_slave_that_was_just_switched_on_asks_for_parameters(bench):
    found = bench.diagnosis()
    assert found.status == StationStatus.STATION_NOT_READY | StationStatus.PRM_REQ | StationStatus.ALWAYS_1
    assert (found.master, found.ident) == (NO_MASTER, IDENT)
    assert bench.slave.min_tsdr_bits == 11
    assert not bench.slave.v1_enabled


def test_the_way_to_data_exchange(bench):
    answer = bench.exchange()
    assert (answer.code, answer.data) == (Answer.DL, bytes(range(12)))
    assert bench.drive.outputs == [DATA]
    status = bench.diagnosis().status
    assert status & StationStatus.WD_ON
    assert not status & StationStatus.STATION_NOT_READY
    assert bench.ask(Sap.READ_INPUTS).data == bytes(range(12))
    assert bench.ask(Sap.READ_OUTPUTS).data == DATA
    assert bench.ask(Sap.GET_CONFIGURATION).data == bench.drive.identifiers


def test_outputs_are_read_only_once_there_were_some(bench):
    bench.parameters()
    bench.ask(Sap.CHECK_CONFIGURATION, bench.drive.identifiers)
    assert bench.slave.state is DpState.DATA_EXCH
    assert not bench.slave.exchanging
    assert bench.ask(Sap.READ_OUTPUTS).code == Answer.RS
    assert bench.ask(Sap.READ_INPUTS).data == bytes(range(12))
    bench.ask(None, DATA)
    assert bench.slave.exchanging
    assert bench.ask(Sap.READ_OUTPUTS).data == DATA


@pytest.mark.parametrize(
    ("dsap", "ssap"),
    [(None, None), (Sap.READ_INPUTS, Sap.MASTER), (Sap.READ_OUTPUTS, Sap.MASTER),
     (Sap.CHECK_CONFIGURATION, Sap.MASTER), (Sap.MSAC1, Sap.MSAC1), (12, Sap.MASTER_2), (17, 33)],
)  # fmt: skip
def test_what_is_not_active_is_answered_with_rs(bench, dsap, ssap):
    answer = bench.ask(dsap, b"\x01", ssap=ssap)
    assert (answer.code, answer.data) == (Answer.RS, b"")
    assert bench.slave.dropped


def test_what_a_chip_would_not_answer_is_not_answered(bench):
    slave = bench.slave
    bench.exchange()
    for telegram in (
        ShortAck(), Token(2, 1), Telegram(4, 2, SRD), Telegram(BROADCAST, 2, SRD), Telegram(3, 2, 0x4E),
        Telegram(3, 2, 0x4F), Telegram(2, 3, 0x08, data=b"x"), Telegram(3, 2, SDN, Sap.GLOBAL_CONTROL, Sap.MASTER, b""),
    ):  # fmt: skip
        assert slave.receive(telegram, bench.now) is None
    assert slave.receive(Telegram(3, 2, STATUS), bench.now) == Telegram(2, 3, Answer.OK)
    assert slave.receive(Telegram(3, 2, SDA, 5, 6), bench.now).code == Answer.RS
    assert slave.state is DpState.DATA_EXCH


def test_an_adapter_that_hears_itself_does_no_harm(bench):
    own = bench.exchange()
    before = (bench.slave.state, len(bench.drive.outputs))
    assert bench.slave.receive(own, bench.now) is None
    assert bench.slave.receive(ShortAck(), bench.now) is None
    assert (bench.slave.state, len(bench.drive.outputs)) == before
    line = DpLine(1)
    line.run(0.5, until=lambda: line.exchanging)
    polls = line.master.stations[0].answers
    # the master hears each of its own requests before the answer
    deliver = line._deliver

    def echoed(octets):
        line.master.receive(parse_telegram(octets), line.now)
        deliver(octets)

    line._deliver = echoed
    line.run(0.1)
    assert line.exchanging
    assert line.master.stations[0].answers > polls + 20
    assert line.master.stations[0].retries == 0


def test_a_repeated_request_is_answered_as_before_and_does_nothing(bench):
    bench.exchange()
    first = Telegram(3, 2, 0x40 | 0x10 | 0x0D, None, None, DATA)
    answer = bench.slave.receive(first, bench.now)
    taken = len(bench.drive.outputs)
    bench.drive.shown = b"\xee" * 12
    assert bench.slave.receive(first, bench.now) == answer
    assert (bench.slave.repeated, len(bench.drive.outputs)) == (1, taken)
    other = Telegram(3, 2, 0x40 | 0x30 | 0x0D, None, None, DATA)
    assert bench.slave.receive(other, bench.now).data == b"\xee" * 12


def test_each_master_has_a_bit_of_its_own_for_repetitions(bench):
    bench.exchange()
    mine = Telegram(3, 2, 0x5D, None, None, DATA)
    bench.slave.receive(mine, bench.now)
    bench.slave.receive(Telegram(3, 7, 0x7D, Sap.SLAVE_DIAGNOSIS, Sap.MASTER), bench.now)
    taken = len(bench.drive.outputs)
    bench.slave.receive(mine, bench.now)
    assert len(bench.drive.outputs) == taken


def test_another_master_sees_that_it_is_locked_and_changes_nothing(bench):
    bench.exchange()
    octets = Parameters(LOCK, (1, 1), 11, IDENT).emit()
    assert bench.ask(Sap.SET_PARAMETERS, octets, source=5) == ShortAck()
    assert bench.ask(None, DATA, source=5).code == Answer.RS
    found = bench.diagnosis(source=5)
    assert found.master == 2
    assert not found.status & StationStatus.MASTER_LOCK, "8.3.1: a bit that masters set"
    assert bench.slave.master == 2
    assert bench.slave.state is DpState.DATA_EXCH


@pytest.mark.parametrize(
    ("given", "bit"),
    [({"ident": IDENT + 1}, StationStatus.PRM_FAULT), ({"factors": (0, 5)}, StationStatus.PRM_FAULT)],
)
def test_parameters_that_do_not_fit_are_told_by_the_diagnosis(bench, given, bit):
    bench.parameters(**given)
    assert bench.slave.state is DpState.WAIT_PRM
    assert bench.diagnosis().status & bit
    assert bench.slave.refusals == 1
    bench.parameters()
    assert not bench.diagnosis().status & bit


@pytest.mark.parametrize(
    ("options", "user", "lacking"),
    [({"supports_sync": False}, "80 00 00", "sync"), ({"supports_freeze": False}, "80 00 00", "freeze"),
     ({}, "C0 00 00", "fail-safe outputs"), ({}, "A0 00 00", "slave-to-slave communication"),
     ({}, "80 00 10", "isochronous mode")],
)  # fmt: skip
def test_what_the_slave_lacks_is_not_supported(options, user, lacking):
    bench = Bench(**options)
    bench.parameters(user=bytes.fromhex(user))
    status = bench.diagnosis().status
    assert status & StationStatus.NOT_SUPPORTED
    assert status & StationStatus.PRM_FAULT
    (refused,) = [event.why for event in bench.slave.take_events() if isinstance(event, ParametersRefused)]
    assert refused == f"{lacking} not supported"


def test_a_refused_set_prm_says_nothing_of_what_the_one_before_it_asked_for():
    bench = Bench(supports_freeze=False)
    bench.parameters(LOCK | PrmStatus.FREEZE_REQ)
    assert bench.diagnosis().status & StationStatus.NOT_SUPPORTED
    bench.parameters(ident=IDENT + 1)
    status = bench.diagnosis().status
    assert status & StationStatus.PRM_FAULT
    assert not status & StationStatus.NOT_SUPPORTED


def test_a_slave_lacks_nothing_that_it_was_not_asked_for():
    bench = Bench(supports_sync=False, supports_freeze=False)
    bench.parameters(PrmStatus.LOCK_REQ | PrmStatus.WD_ON)
    assert bench.slave.state is DpState.WAIT_CFG
    assert not bench.diagnosis().status & StationStatus.NOT_SUPPORTED


def test_parameters_in_data_exchange_begin_the_way_again(bench):
    bench.exchange()
    bench.slave.take_events()
    assert bench.parameters() == ShortAck()
    assert bench.slave.state is DpState.WAIT_CFG
    assert [event.why for event in bench.slave.take_events() if isinstance(event, Left)] == [PARAMETERS_AGAIN]


def test_octets_of_a_user_without_dp_v1_ask_for_no_modes_of_it():
    bench = Bench(v1=False)
    bench.parameters(user=bytes.fromhex("FF FF FF"))
    assert bench.slave.state is DpState.WAIT_CFG
    assert bench.slave.watchdog_ns == 100 * MS


def test_alarms_are_not_supported(bench):
    bench.exchange()
    assert bench.ask(Sap.MSAC1, bytes.fromhex("5C 00 01 05"), ssap=Sap.MSAC1) == ShortAck()
    assert bench.ask(Sap.MSAC1, ssap=Sap.MSAC1).data == bytes.fromhex("DC 80 A9 00")
    assert bench.ask(Sap.MSAC1, ssap=Sap.MSAC1) == ShortAck()


def test_unlock_releases_and_no_lock_changes_the_time_alone(bench):
    bench.exchange()
    bench.slave.take_events()
    assert bench.parameters(0, tsdr=60) == ShortAck()
    assert bench.slave.state is DpState.DATA_EXCH
    assert bench.slave.min_tsdr_bits == 60
    assert bench.parameters(PrmStatus.UNLOCK_REQ) == ShortAck()
    assert bench.slave.state is DpState.WAIT_PRM
    assert [event.why for event in bench.slave.take_events() if isinstance(event, Left)] == ["unlocked"]


def test_outputs_of_another_length_end_the_data_exchange(bench):
    bench.exchange()
    assert bench.ask(None, DATA + b"x").code == Answer.RS
    assert bench.slave.state is DpState.WAIT_PRM


def test_a_configuration_that_does_not_fit_ends_it_too(bench):
    bench.exchange()
    bench.ask(Sap.CHECK_CONFIGURATION, b"\x11")
    assert bench.slave.state is DpState.WAIT_PRM
    assert bench.diagnosis().status & StationStatus.CFG_FAULT
    assert bench.slave.refusals == 1


def test_a_configuration_of_another_length_leaves_nothing_held_and_nothing_frozen(bench):
    bench.exchange()
    control(bench, Control.FREEZE | Control.SYNC)
    check = bench.drive.check_configuration

    def taken(identifiers):
        bench.drive.identifiers, bench.drive.octets = b"\xf1", 4
        return check(identifiers)

    bench.drive.check_configuration = taken
    assert bench.ask(Sap.CHECK_CONFIGURATION, b"\xf1") == ShortAck()
    assert len(bench.ask(None, b"\x01" * 4).data) == 4
    assert bench.ask(Sap.READ_OUTPUTS).data == b"\x01" * 4
    assert not bench.diagnosis().status & (StationStatus.FREEZE_MODE | StationStatus.SYNC_MODE)


def test_commands_that_set_prm_did_not_ask_for_are_ignored(bench):
    bench.parameters(PrmStatus.LOCK_REQ)
    bench.ask(Sap.CHECK_CONFIGURATION, bench.drive.identifiers)
    bench.ask(None, DATA)
    control(bench, Control.SYNC | Control.FREEZE)
    assert not bench.diagnosis().status & (StationStatus.FREEZE_MODE | StationStatus.SYNC_MODE | StationStatus.WD_ON)
    bench.ask(None, b"\x01" * 12)
    assert bench.drive.outputs[-1] == b"\x01" * 12


def test_sync_waits_for_the_end_of_clear(bench):
    bench.exchange()
    control(bench, Control.SYNC | Control.CLEAR_DATA)
    bench.ask(None, b"\x01" * 12)
    assert bench.ask(Sap.READ_OUTPUTS).data == bytes(12)
    control(bench, 0)
    bench.ask(None, b"\x02" * 12)
    assert bench.drive.outputs == [DATA], "Sync still holds them"
    control(bench, Control.SYNC)
    assert bench.drive.outputs[-1] == b"\x02" * 12


def test_inputs_and_outputs_are_read_by_any_master(bench):
    bench.exchange()
    assert bench.ask(Sap.READ_INPUTS, source=9).data == bytes(range(12))
    assert bench.ask(Sap.READ_OUTPUTS, source=9).data == DATA
    assert bench.ask(Sap.GET_CONFIGURATION, source=9).data == bench.drive.identifiers
    assert bench.slave.master == 2


def test_empty_outputs_are_clear_only_for_a_slave_with_fail_safe_that_was_asked_for_it():
    bench = Bench(supports_fail_safe=True)
    bench.parameters(user=b"\xc0\x00\x00")
    bench.ask(Sap.CHECK_CONFIGURATION, bench.drive.identifiers)
    assert bench.ask(None, b"").code == Answer.DL
    assert bench.drive.cleared == 1
    for options in ({}, {"supports_fail_safe": True}):
        other = Bench(**options)
        other.exchange()
        assert other.ask(None, b"").code == Answer.RS
        assert other.slave.state is DpState.WAIT_PRM
    # without DP-V1, Set_Prm has no bit for it
    older = Bench(supports_fail_safe=True, v1=False)
    older.exchange()
    assert older.ask(None, b"").code == Answer.DL
    assert older.drive.cleared == 1


def control(bench, command, groups=0, source=2, destination=BROADCAST):
    octets = GlobalControl(command, groups).emit()
    telegram = Telegram(destination, source, SDN, Sap.GLOBAL_CONTROL, Sap.MASTER, octets)
    assert bench.slave.receive(telegram, bench.now) is None


def test_sync_holds_outputs_and_freeze_holds_inputs(bench):
    bench.exchange()
    control(bench, Control.SYNC)
    assert bench.diagnosis().status & StationStatus.SYNC_MODE
    taken = len(bench.drive.outputs)
    bench.ask(None, b"\x01" * 12)
    assert len(bench.drive.outputs) == taken
    assert bench.ask(Sap.READ_OUTPUTS).data == DATA, "those in force are read, not those that wait"
    control(bench, Control.SYNC)
    assert bench.drive.outputs[-1] == b"\x01" * 12
    control(bench, Control.UNSYNC)
    bench.ask(None, b"\x02" * 12)
    assert bench.drive.outputs[-1] == b"\x02" * 12
    control(bench, Control.FREEZE)
    bench.drive.shown = b"\xaa" * 12
    assert bench.ask(None, DATA).data == bytes(range(12))
    control(bench, Control.UNFREEZE)
    assert bench.ask(None, DATA).data == b"\xaa" * 12


def test_clear_begins_and_ends_and_freezes_nothing(bench):
    bench.exchange()
    bench.slave.take_events()
    control(bench, Control.CLEAR_DATA)
    control(bench, Control.CLEAR_DATA)
    control(bench, 0)
    assert bench.slave.take_events() == [ClearChanged(True), ClearChanged(False)]
    bench.drive.shown = b"\xaa" * 12
    assert bench.ask(None, DATA).data == b"\xaa" * 12


def test_data_to_another_access_point_is_no_command(bench):
    bench.exchange()
    for dsap, ssap in ((60, Sap.MASTER), (Sap.GLOBAL_CONTROL, 61)):
        octets = GlobalControl(Control.CLEAR_DATA, 0).emit()
        assert bench.slave.receive(Telegram(BROADCAST, 2, SDN, dsap, ssap, octets), bench.now) is None
    assert not bench.slave.clear


def test_data_exchanges_count_also_where_outputs_are_held_and_nothing_else_counts_as_one(bench):
    bench.exchange()
    control(bench, Control.SYNC | Control.FREEZE)
    control(bench, Control.CLEAR_DATA)
    bench.ask(Sap.READ_INPUTS, source=9)
    bench.diagnosis()
    assert bench.drive.exchanges == 1
    for _ in range(5):
        bench.ask(None, DATA)
    assert bench.drive.exchanges == 6


def test_control_for_other_groups_or_of_other_masters_is_not_its_own(bench):
    bench.exchange()
    control(bench, Control.CLEAR_DATA, groups=2)
    control(bench, Control.CLEAR_DATA, source=9)
    assert not bench.slave.clear
    control(bench, Control.CLEAR_DATA, groups=1)
    assert bench.slave.clear
    assert bench.drive.cleared == 1


def test_the_watchdog_ends_what_its_master_no_longer_asks_for(bench):
    bench.exchange()
    bench.slave.take_events()
    assert bench.slave.next_deadline() == bench.now + 100 * MS
    bench.now += 60 * MS
    bench.ask(Sap.SLAVE_DIAGNOSIS, source=9)
    bench.slave.handle_timeout(bench.now + 39 * MS)
    assert bench.slave.state is DpState.DATA_EXCH
    changes = []
    bench.slave.changed = lambda: changes.append(bench.slave.state)
    bench.slave.handle_timeout(bench.now + 40 * MS)
    assert bench.slave.state is DpState.WAIT_PRM
    assert changes, "the next poll is not like the one before"
    assert [event.why for event in bench.slave.take_events() if isinstance(event, Left)] == ["watchdog"]


def test_the_address_changes_with_the_answer_and_only_where_it_may(bench):
    assert bench.ask(Sap.SET_SLAVE_ADDRESS, SetAddress(8, IDENT, locks=True).emit()) == ShortAck()
    assert bench.slave.address == 8
    assert AddressSet(8, locks=True, master=2) in bench.slave.take_events()
    answer = bench.slave.receive(
        Telegram(8, 2, SRD, Sap.SET_SLAVE_ADDRESS, Sap.MASTER, SetAddress(9, IDENT).emit()), bench.now
    )
    assert answer.code == Answer.RS
    other = Bench()
    other.ask(Sap.SET_SLAVE_ADDRESS, SetAddress(8, IDENT + 1).emit())
    assert other.slave.address == 3
    fixed = Bench(address_changes=False)
    assert fixed.ask(Sap.SET_SLAVE_ADDRESS, SetAddress(8, IDENT).emit()).code == Answer.RS
    assert fixed.slave.address == 3


def test_the_baud_rate_is_sought_after_silence(bench):
    assert bench.slave.next_deadline() is None, "there is none to lose yet"
    bench.slave.receive(Telegram(9, 2, STATUS), bench.now)
    assert bench.slave.next_deadline() == bench.now + 5_000 * MS
    assert [type(event) for event in bench.slave.take_events()] == [BaudFound]
    bench.slave.handle_timeout(bench.now + 5_000 * MS)
    assert [type(event) for event in bench.slave.take_events()] == [BaudLost]
    assert not bench.slave.found
    assert bench.slave.next_deadline() is None


def test_a_static_diagnosis_is_asked_for_again(bench):
    bench.exchange()
    bench.drive.static = True
    bench.slave.diagnosis_changed()
    for _ in range(3):
        assert bench.ask(None, DATA).code == Answer.DH
        assert bench.diagnosis().status & StationStatus.STAT_DIAG
    bench.drive.static = False
    bench.diagnosis()
    assert bench.ask(None, DATA).code == Answer.DL


def test_class_1_reads_and_writes_only_with_dp_v1_enabled(bench):
    bench.exchange()
    write = Access(Function.WRITE, 0, 47, 2, b"hi").emit()
    assert bench.ask(Sap.MSAC1, write, ssap=Sap.MSAC1) == ShortAck()
    assert bench.ask(Sap.MSAC1, ssap=Sap.MSAC1).data == bytes.fromhex("5f 00 2f 02")
    bench.ask(Sap.MSAC1, Access(Function.READ, 0, 47, 200).emit(), ssap=Sap.MSAC1)
    busy = bench.ask(Sap.MSAC1, Access(Function.READ, 0, 47, 200).emit(), ssap=Sap.MSAC1)
    assert busy.code == Answer.RR
    assert bench.ask(Sap.MSAC1, ssap=Sap.MSAC1).data == bytes.fromhex("5e 00 2f 02") + b"hi"
    assert bench.ask(Sap.MSAC1, b"\x00", ssap=Sap.MSAC1).code == Answer.UE
    bench.drive.refuse = (0xB0, 7)
    bench.ask(Sap.MSAC1, Access(Function.READ, 0, 48, 20).emit(), ssap=Sap.MSAC1)
    assert bench.ask(Sap.MSAC1, ssap=Sap.MSAC1).data == bytes.fromhex("de 80 b0 07")
    plain = Bench()
    plain.parameters(user=b"")
    plain.ask(Sap.CHECK_CONFIGURATION, plain.drive.identifiers)
    assert plain.ask(Sap.MSAC1, write, ssap=Sap.MSAC1).code == Answer.RS


def initiated(bench, source=5):
    manager = bench.ask(Sap.RESOURCE_MANAGER, Initiate(500_000_000).emit(), ssap=Sap.MASTER_2, source=source)
    assert manager.data[0] == Function.RESOURCE_MANAGER
    sap = manager.data[1]
    assert bench.ask(sap, ssap=Sap.MASTER_2, source=source).data[0] == Function.INITIATE
    return sap


def test_several_masters_of_class_2_have_connections_of_their_own():
    bench = Bench(connections=2)
    first, second = initiated(bench), initiated(bench, source=6)
    assert first != second
    full = bench.ask(Sap.RESOURCE_MANAGER, Initiate(10).emit(), ssap=Sap.MASTER_2, source=7)
    assert full.code == Answer.RR
    assert bench.ask(second, ssap=Sap.MASTER_2, source=5).code == Answer.RS, "it is another's"
    bench.ask(first, Access(Function.WRITE, 0, 47, 1, b"a").emit(), ssap=Sap.MASTER_2, source=5)
    assert bench.ask(first, ssap=Sap.MASTER_2, source=5).data[0] == Function.WRITE
    bench.ask(first, bytes((Function.IDLE,)), ssap=Sap.MASTER_2, source=5)
    assert bench.ask(first, ssap=Sap.MASTER_2, source=5).data == bytes((Function.IDLE,))
    bench.ask(first, bytes((Function.DATA_TRANSPORT, 0, 47, 1, 9)), ssap=Sap.MASTER_2, source=5)
    assert bench.ask(first, ssap=Sap.MASTER_2, source=5).data[0] == 0xD1
    bench.ask(first, bytes((Function.ABORT, 0, 0x20)), ssap=Sap.MASTER_2, source=5)
    assert bench.slave.class_two.open == [(6, second)]
    assert bench.drive.gone == [first + 1]


def test_requests_of_class_2_with_exchanged_access_points_are_taken_where_the_model_says_so():
    initiate = Initiate(500_000_000).emit()
    assert Bench().ask(Sap.MASTER_2, initiate, ssap=Sap.RESOURCE_MANAGER, source=5).code == Answer.RS
    bench = Bench(class_two_exchanged=True)
    manager = bench.ask(Sap.MASTER_2, initiate, ssap=Sap.RESOURCE_MANAGER, source=5)
    assert (manager.dsap, manager.ssap) == (Sap.RESOURCE_MANAGER, Sap.MASTER_2)
    sap = manager.data[1]
    assert bench.ask(Sap.MASTER_2, ssap=sap, source=5).data[0] == Function.INITIATE
    bench.ask(Sap.MASTER_2, Access(Function.WRITE, 0, 47, 1, b"a").emit(), ssap=sap, source=5)
    assert bench.ask(Sap.MASTER_2, ssap=sap, source=5).data[0] == Function.WRITE
    assert initiated(bench, source=6) != sap, "the usual order beside it"


@pytest.mark.parametrize(
    ("data", "reason"),
    [(b"\x00", 0x15), (bytes((Function.READ, 0)), 0x14), (bytes((Function.WRITE, 0, 47, 5, 1)), 0x14)],
)
def test_a_wrong_pdu_aborts_the_connection_with_its_reason(bench, data, reason):
    sap = initiated(bench)
    bench.ask(sap, data, ssap=Sap.MASTER_2, source=5)
    assert bench.ask(sap, ssap=Sap.MASTER_2, source=5).data == bytes((Function.ABORT, 0, reason))
    assert bench.ask(sap, ssap=Sap.MASTER_2, source=5).code == Answer.RS


def test_a_silent_master_of_class_2_loses_its_connection(bench):
    initiated(bench)
    bench.slave.handle_timeout(bench.now + 1499 * MS)
    assert bench.slave.class_two.open
    bench.slave.handle_timeout(bench.now + 1500 * MS)
    assert not bench.slave.class_two.open
    bench.slave.handle_timeout(bench.now + 4000 * MS)
    assert bench.slave.class_two.next_deadline() is None


def test_every_state_has_a_way_back_for_every_sign_that_it_can_get():
    assert {state for state, _ in TRANSITIONS} == {DpState.WAIT_PRM, DpState.WAIT_CFG, DpState.DATA_EXCH}
    assert all(TRANSITIONS[state, sign] in DpState for state, sign in TRANSITIONS)


class AnyTelegrams(RuleBasedStateMachine):
    """Whatever comes, a slave answers with a telegram that can be sent, or not at all."""

    def __init__(self):
        super().__init__()
        self.bench = Bench()

    @rule(
        destination=st.sampled_from([3, 3, 3, 127, 9]), source=st.sampled_from([2, 2, 5, 126]),
        function=st.sampled_from([0x5D, 0x7D, SRD, SRD, SDN, SDA, STATUS, 0x4C, 0x42]),
        dsap=st.sampled_from([None, *Sap, 0, 1, 2, 48]), ssap=st.sampled_from([None, 62, 51, 50, 33]),
        data=st.binary(max_size=20),
    )  # fmt: skip
    def telegram(self, destination, source, function, dsap, ssap, data):
        answer = self.bench.slave.receive(Telegram(destination, source, function, dsap, ssap, data), self.bench.now)
        if answer is not None:
            assert emit_telegram(answer)

    @rule()
    def connect(self):
        if self.bench.slave.address == 3:
            self.bench.parameters()
            self.bench.ask(Sap.CHECK_CONFIGURATION, self.bench.drive.identifiers)
            self.bench.ask(None, DATA)

    @rule(milliseconds=st.sampled_from([1, 50, 200, 6000]))
    def time(self, milliseconds):
        self.bench.now += milliseconds * MS
        self.bench.slave.handle_timeout(self.bench.now)
        due = self.bench.slave.next_deadline()
        assert due is None or due > self.bench.now

    @invariant()
    def is_consistent(self):
        slave = self.bench.slave
        assert (slave.state is DpState.WAIT_PRM) == (slave.master == NO_MASTER)
        assert len(slave.class_two._connections) <= 4


TestAnyTelegrams = AnyTelegrams.TestCase
TestAnyTelegrams.settings = settings(max_examples=60, stateful_step_count=40)
