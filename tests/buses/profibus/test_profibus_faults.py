"""Faults of drives on PROFIBUS: what the master and the drive show meanwhile, and that all is as before behind them."""

import pytest

from pnfarm.buses.profibus.faults.on_bus import ON_PROFIBUS
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.faults.errors import InjectionError
from pnfarm.protocols.profibus.wire.dp import DpState, StationStatus

NUMBER = {"drive-fault": {"fault": "9-1"}, "drive-warning": {"warning": 1}, "digital-input": {"input": 0}}


class Bench:
    """Two drives that turn, and their master; faults hit the first drive."""

    def __init__(self, farm, **options):
        self.line = farm(2, **options)
        self.core, self.name = self.line.core, "msd-01"
        self.line.run(0.5)

    @property
    def station(self):
        """The master's view of the slave."""
        return self.line._line.plc.master.stations[0]

    @property
    def device(self):
        return self.core.axis(self.name).device

    def inject(self, kind, **fields):
        given = {"kind": kind, "on": self.name, **fields}
        return self.core.injections.inject(given, self.line.now_ns)

    def clear(self, seconds=1.5):
        self.core.injections.clear(None, self.line.now_ns)
        self.line.run(seconds)

    def diagnosis(self):
        """The status bits of the diagnosis that the master read last."""
        return self.station.diagnosis.status

    def turns(self):
        return [drive.state for drive in self.line.drives] == ["S4", "S4"]

    def lost(self):
        return self.device.losses()


@pytest.fixture
def bench(farm):
    return Bench(farm)


@pytest.mark.parametrize("kind", ["wrong-ident", "config-fault"])
def test_a_slave_that_does_not_fit_is_refused_until_the_fault_ends_and_then_turns_again(bench, kind):
    injection = bench.inject(kind)
    if kind == "wrong-ident":
        bench.inject("link-down", **{"for": "300ms"})
    bench.line.run(2.0)
    assert not bench.device.connected
    assert bench.turns() is False
    bit = {"wrong-ident": StationStatus.PRM_FAULT, "config-fault": StationStatus.CFG_FAULT}[kind]
    assert bench.diagnosis() & bit or bench.station.diagnosis.ident == 0xFFFF
    assert injection.evidence().activations >= 1
    bench.clear()
    assert bench.device.connected
    assert bench.turns()


def test_a_diagnosis_request_is_read_with_its_block_while_data_are_exchanged(bench):
    before = bench.device.slave.diagnoses
    injection = bench.inject("diagnosis-request", params={"code": 0x1234})
    bench.line.run(0.2)
    assert bench.device.slave.diagnoses > before
    assert bench.station.diagnosis.extended == bytes.fromhex("03 12 34")
    assert bench.diagnosis() & StationStatus.EXT_DIAG
    assert bench.device.connected
    assert injection.evidence().confirmed
    bench.clear(0.3)
    assert not bench.diagnosis() & StationStatus.EXT_DIAG
    assert bench.turns()


@pytest.mark.parametrize("kind", ["diagnosis-request", "config-fault"])
def test_a_fault_whose_slave_boots_before_its_master_met_it_is_confirmed_behind_the_boot(bench, kind):
    # what the master met before does not count
    bench.inject(kind)
    bench.line.run(0.5)
    bench.clear()
    fault = bench.inject(kind)
    bench.core.axis(bench.name).station.power_cycle(bench.line.now_ns)
    assert not fault.evidence().confirmed
    bench.line.run(3.0)
    assert fault.evidence().confirmed
    bench.clear()
    assert bench.turns()


def test_a_static_diagnosis_is_read_again_and_again_until_it_ends(bench):
    bench.inject("static-diagnosis")
    bench.line.run(0.3)
    first = bench.device.slave.diagnoses
    assert bench.diagnosis() & StationStatus.STAT_DIAG
    bench.line.run(0.3)
    assert bench.device.slave.diagnoses > first + 5
    bench.clear(0.3)
    read = bench.device.slave.diagnoses
    bench.line.run(0.3)
    assert bench.device.slave.diagnoses == read
    assert bench.turns()


def test_another_baud_rate_makes_a_slave_deaf_and_it_finds_the_rate_again(bench):
    bench.inject("baud-change")
    bench.line.run(1.0)
    seen = drive_snapshot(bench.core, bench.core.axis(bench.name), bench.line.now_ns)
    assert not seen["connected"]
    assert seen["details"]["baud"] is None
    assert seen["lamps"]["H2 red"] == "flashing", "seeking, after a connection"
    assert sum(bench.lost().values()) == 1
    bench.clear()
    assert drive_snapshot(bench.core, bench.core.axis(bench.name), bench.line.now_ns)["details"]["baud"] == 1_500_000
    assert bench.turns()


def test_noise_is_counted_by_the_master_and_repetitions_get_through(bench):
    before = bench.station.retries
    injection = bench.inject("line-noise", params={"every": "7ms", "octets": 12})
    bench.line.run(2.0)
    assert injection.evidence().activations > 100
    assert bench.line._line.plc.master.counts["broken"] + bench.station.retries > before
    bench.clear()
    assert bench.turns()


@pytest.mark.parametrize(
    ("kind", "fields"),
    [("silence", {}), ("timeout", {}), ("link-down", {}), ("loss", {"probability": 1.0})],
)
def test_a_slave_that_does_not_answer_is_lost_after_the_repetitions_and_comes_back(bench, kind, fields):
    losses, connects = bench.station.losses, bench.device.connects
    bench.inject(kind, **fields)
    bench.line.run(0.5)
    assert bench.station.losses == losses + 1
    assert bench.core.axis("msd-02").device.connected, "the line goes on"
    bench.clear()
    assert bench.device.connects > connects
    assert bench.turns()


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_missing_answers_than_repetitions_cost_nothing(farm, count):
    bench = Bench(farm, keys="retries: 1")
    losses = bench.station.losses
    bench.inject("drop-cycles", count=count)
    bench.line.run(0.3)
    assert bench.station.losses == losses + (count > 1)
    bench.clear()
    assert bench.turns()


def test_a_fault_begins_behind_so_many_cycles_of_healthy_answers(farm):
    bench = Bench(farm, keys="retries: 3")
    polls = bench.station.polls
    fault = bench.inject("drop-cycles", after_cycles=50, count=1)
    assert bench.line.wait_until(lambda: fault.evidence().activations == 1, 2.0)
    assert 49 <= bench.station.polls - polls <= 53
    assert fault.evidence().checks == 51


def test_an_acyclic_answer_that_is_delayed_once_is_late_before_the_fault_ends(farm):
    bench = Bench(farm)
    fault = bench.inject("delay", direction="out", count=1, params={"frames": "acyclic", "delay": "30ms"})
    bench.inject("diagnosis-request")
    assert bench.line.wait_until(lambda: fault.evidence().activations == 1, 2.0)
    bench.line.run(0.02)
    assert fault.state == "active"
    assert bench.line.wait_until(lambda: fault.state == "ended", 1.0)
    assert fault.evidence().confirmed


def test_noise_of_a_slave_without_supply_neither_counts_nor_waits(bench):
    fault = bench.inject("line-noise", params={"every": "1ms", "octets": 200})
    bench.line.run(0.1)
    seen = fault.evidence().activations
    assert seen > 50
    bench.core.axis(bench.name).station.power_off(bench.line.now_ns)
    bench.line.run(2.0)
    assert fault.evidence().activations - seen <= 1
    assert bench.device._answers == []
    bench.core.axis(bench.name).station.power_on(bench.line.now_ns)
    bench.clear(3.0)
    assert bench.turns()


@pytest.mark.parametrize("what", ["loop", "lines"])
@pytest.mark.parametrize(("late_ns", "cause"), [(0, "controller"), (20_000_000, "farm")])
def test_a_slave_that_its_master_starts_anew_behind_a_late_answer_is_the_farms_own_loss(farm, late_ns, cause, what):
    bench = Bench(farm, keys="retries: 1", watchdog="2s")
    bench.inject("drop-cycles", count=2)
    bench.line.run(0.006)
    # what is noted in real time of the event loop, and of the kernel that carries the line's octets
    getattr(bench.core.lateness, what).note(bench.line.now_ns, late_ns)
    bench.line.run(0.5)
    (lost,) = bench.line.events("connection lost")
    assert (lost.data["reason"], lost.data["cause"]) == ("parametrised-again", cause)
    assert bench.device.losses_by_farm() == ({"parametrised-again": 1} if cause == "farm" else {})
    assert bench.device.losses() == {"parametrised-again": 1}


def test_wrong_octets_fail_the_check_sum_and_the_request_is_repeated(bench):
    before = bench.station.retries
    bench.inject("corrupt", probability=0.2, seed=3)
    bench.line.run(1.0)
    assert bench.station.retries > before + 5
    bench.clear()
    assert bench.turns()


def test_an_answer_that_is_late_beyond_the_slot_time_is_missed(farm):
    bench = Bench(farm, keys="latency: 1ms")
    before = bench.station.retries
    bench.inject("late-frames", params={"by": "6ms"})
    bench.line.run(0.3)
    assert bench.station.retries > before
    bench.clear()
    assert bench.turns()


@pytest.mark.parametrize("kind", ["watchdog-expire", "timeout"])
def test_an_expired_watchdog_raises_error_32_1_and_zeroes_the_outputs(bench, kind):
    bench.inject(kind)
    bench.line.run(0.25)
    station = bench.core.axis(bench.name)
    assert station.fault_counts == {1 << 16 | 32: 1}
    assert bench.device.watchdog_expirations == 1
    bench.clear(2.0)
    assert bench.turns()


def test_a_power_cycle_is_one_of_the_slave_and_the_line_goes_on(bench):
    bench.inject("power-cycle", params={"off": "500ms"})
    bench.line.run(0.3)
    assert drive_snapshot(bench.core, bench.core.axis(bench.name), bench.line.now_ns)["state"] == "off"
    assert bench.core.axis("msd-02").device.connected
    bench.clear(3.0)
    assert bench.turns()


@pytest.mark.parametrize(("access", "error"), [("class-1", "0xB0"), ("class-2", "0xB0")])
def test_records_are_refused_with_the_code_that_is_asked_for(farm, access, error):
    bench = Bench(farm, keys=f"access: {access}")
    bench.inject("record-error", params={"error": "invalid-index"})
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    bench.line.run(0.5)
    assert job.done
    assert error in job.error
    bench.clear(0.2)
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    bench.line.run(0.5)
    assert job.ok


def test_an_answer_to_a_parameter_request_takes_as_long_as_is_asked_for(bench):
    bench.inject("record-delay", params={"delay": "300ms"})
    begun = bench.line.now_ns
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", begun)
    bench.line.run(0.2)
    assert not job.done
    bench.line.run(0.5)
    assert job.ok


def test_each_delay_counts_the_answers_that_it_held_and_ends_with_its_own(bench):
    one = bench.inject("record-delay", count=1, params={"delay": "100ms"})
    never = bench.inject("record-delay", count=1, probability=1e-9, seed=1, params={"delay": "100ms"})
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    assert bench.line.wait_until(lambda: job.done, 2.0)
    bench.line.run(0.2)
    assert (one.state, one.evidence().activations, one.evidence().confirmed) == ("ended", 1, True)
    assert (never.state, never.evidence().activations, never.evidence().confirmed) == ("active", 0, False)


def test_a_delay_of_one_answer_ends_though_the_drive_boots_meanwhile(bench):
    fault = bench.inject("record-delay", count=1, params={"delay": "10s"})
    bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    bench.line.run(0.2)
    assert fault.state == "active"
    bench.core.axis(bench.name).station.power_cycle(bench.line.now_ns)
    assert bench.line.wait_until(lambda: fault.state == "ended", 3.0)


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_a_delay_of_one_answer_ends_though_the_connection_of_who_asks_ends(farm, access):
    bench = Bench(farm, keys=f"access: {access}")
    fault = bench.inject("record-delay", count=1, params={"delay": "60s"})
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    bench.line.run(0.2)
    assert (fault.state, job.done) == ("active", False)
    if access == "class-1":
        bench.inject("ar-abort", count=1)
    else:
        bench.core.axis(bench.name).station.device.slave.class_two.close_all()
    assert bench.line.wait_until(lambda: job.done, 20.0)
    assert (fault.state, fault.evidence().confirmed) == ("ended", False)
    # the next one is not held by what was left of the first
    bench.clear(3.0)
    bench.inject("record-delay", params={"delay": "300ms"})
    job = bench.line._line.plc.read_parameter(bench.name, "P-0918", bench.line.now_ns)
    assert bench.line.wait_until(lambda: job.ok, 2.0)


def test_a_cut_line_is_every_slave_at_once_and_all_come_back(farm):
    bench = Bench(farm)
    bench.core.injections.inject({"kind": "link-down", "on": "all", "for": "500ms"}, bench.line.now_ns)
    bench.line.run(0.3)
    assert not any(station.device.connected for station in bench.core.axes)
    bench.line.run(2.0)
    assert bench.turns()


def test_a_configuration_is_refused_also_where_the_fault_begins_between_chk_cfg_and_the_first_data(farm):
    line = farm(running=False)
    device = line.core.axis("msd-01").device

    def between():
        return device.slave.state is DpState.DATA_EXCH and not device.slave.exchanging

    assert line._line.world.run(5, until=between, look_ns=10_000)
    line.inject("config-fault", on="msd-01")
    line.run(1)
    assert not device.slave.exchanging
    assert device.counted()["refused"] > 0


def test_a_master_that_is_refused_again_and_again_leaves_the_log_room_for_what_else_happens(bench):
    bench.inject("config-fault")
    bench.line.run(30)
    refused = [entry for entry in bench.line.events("connection refused") if entry.drive == bench.name]
    assert len(refused) == 12
    assert bench.device.counted()["refused"] > 100
    assert bench.line.drive(bench.name).events("fault injected")
    bench.clear()
    last = [entry for entry in bench.line.events("connection refused") if entry.drive == bench.name][-1]
    assert last.data["repeated"] == bench.device.counted()["refused"] - 12
    assert bench.turns()


REFUSED = sorted(kind for kind, on in ON_PROFIBUS.items() if on.refused)


@pytest.mark.parametrize("kind", REFUSED)
def test_a_kind_that_the_bus_does_not_have_is_refused_with_the_reason(bench, kind):
    with pytest.raises(InjectionError):
        bench.inject(kind, params=NUMBER.get(kind, {}))
    assert bench.turns()
