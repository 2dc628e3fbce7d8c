"""A drive that takes its time over parameter requests: a PLC program has to poll."""

from __future__ import annotations

from ipaddress import IPv4Interface

import pytest
from bystander import Bystander
from initiator import Initiator
from record_line import changing, reading
from shared_line import SharedLine
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.records import RecordJob
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.cm.connect import ArProperties, ArType

API = 0x3A00
#: Model, cycle, telegram, the record indexes of its manual and of the profile, and a parameter that every drive has.
MODELS = [
    ("akd-profinet", "16ms", 1, 47),
    ("akd-profinet", "16ms", 1, 0xB02E),
    ("akd-profinet", "16ms", 1, 0xB02F),
    ("akd-profinet-2012", "8ms", 1, 47),
    ("hiwin-e1", "1ms", 3, 0xB02F),
    ("moog-msd", "1ms", 1, 0xB02E),
]
NOT_YET = "IODReadRes: state conflict (DE 80 B5 00)"
REFUSED = "IODWriteRes: state conflict (DF 80 B5 00)"
#: PNU 964, one of the profile's: the manufacturer.
ASKED = reading((964, 0, 1))


def finished(line: VirtualLine, job: RecordJob) -> RecordJob:
    assert line.world.run(2.0, until=lambda: job.done), "no answer to the record call"
    return job


def write(line: VirtualLine, request: bytes, index: int = 47) -> RecordJob:
    return finished(line, line.plc.write_record("axis-01", (API, 1, 1, index), request, line.world.now))


def read(line: VirtualLine, index: int = 47) -> bytes | str:
    """The response, or the drive's refusal in words."""
    job = finished(line, line.plc.read_record("axis-01", (API, 1, 1, index), line.world.now))
    return job.failure if job.data is None or job.failure else job.data


def line_of(realism: str, *, model: str = "akd-profinet", cycle: str = "16ms", **options) -> VirtualLine:
    line = VirtualLine(model=model, cycle=cycle, realism=realism, **options)
    line.connect()
    line.run(0.5)
    return line


@pytest.mark.parametrize(("model", "cycle", "telegram", "index"), MODELS)
def test_the_answer_is_refused_until_the_time_is_over(model, cycle, telegram, index):
    line = line_of("{parameter_latency: 200ms}", model=model, cycle=cycle, telegram=telegram)
    asked = line.world.now
    assert write(line, ASKED, index).ok, "the request itself is taken at once"
    polls = 0
    while (found := read(line, index)) == NOT_YET:
        polls += 1
        line.run(0.010)
    assert polls > 3
    assert isinstance(found, bytes)
    assert found[:2] == bytes.fromhex("0701"), "the positive answer to this request"
    assert 0.2 <= (line.world.now - asked) / 1e9 < 0.25
    assert read(line, index) == NOT_YET, "it is there once"


def test_without_latency_the_first_read_brings_it():
    line = line_of("off")
    assert write(line, ASKED).ok
    assert isinstance(read(line), bytes)


def test_a_second_request_meets_the_state_conflict_and_the_first_one_is_answered():
    line = line_of("{parameter_latency: 100ms}")
    assert write(line, ASKED).ok
    assert write(line, reading((922, 0, 1))).failure == REFUSED
    line.run(0.1)
    assert read(line) == bytes.fromhex("07 01 00 01 42 01 0105")
    assert write(line, reading((922, 0, 1))).ok, "now the drive is free"


def test_a_change_takes_effect_when_the_drive_is_done_with_it():
    line = line_of("{parameter_latency: 100ms}")
    store = line.farm.axes[0].store
    before = store.get(1004)
    assert write(line, changing(1004, 0x42, 77)).ok
    line.run(0.05)
    assert store.get(1004) == before
    line.run(0.1)
    assert store.get(1004) == 77


def test_the_end_of_the_connection_forgets_what_the_drive_works_on():
    """Neither is it carried out, nor does the next connection get an answer."""
    line = line_of("{parameter_latency: 2s}")
    station = line.farm.axes[0]
    before = station.store.get(1004)
    assert write(line, changing(1004, 0x42, 77)).ok
    assert station.device.kind.records.next_deadline() is not None
    for ar in list(station.device.ars):
        station.device.cm.abort(ar, RtaError.DEVICE_DEACTIVATED, line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert station.device.kind.records.next_deadline() is None
    line.connect()
    line.run(3.0)
    assert station.store.get(1004) == before
    assert read(line) == NOT_YET


def test_a_power_cycle_forgets_it_too():
    line = line_of("{parameter_latency: 2s}")
    station = line.farm.axes[0]
    before = station.store.get(1004)
    assert write(line, changing(1004, 0x42, 77)).ok
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(3.0)
    assert station.store.get(1004) == before


def test_an_engineering_tool_has_a_request_of_its_own():
    """One request of each client: a tool that reads takes nothing away, and a lost tool leaves nothing behind."""
    line = line_of("{parameter_latency: 300ms}")
    station = line.farm.axes[0]
    tool = Bystander(line.world, "tool", bytes([2, 0, 0, 0x77, 0, 1]), IPv4Interface("10.77.1.77/23"))
    assert write(line, ASKED).ok
    assert tool.read_without(station, 47, API, 1, 1) is None, "it asked for nothing"
    line.run(0.4)
    assert isinstance(read(line), bytes)


def test_a_tool_that_goes_leaves_no_request_behind():
    """A device access AR has no cyclic data: what it asked ends with it, though, however it ends."""
    line = line_of("{parameter_latency: 10s}")
    station = line.farm.axes[0]
    before = station.store.get(1004)
    tool = Initiator(line, 1, IPv4Interface("10.77.1.78/23"))

    def work() -> None:
        answer = tool.connect(station, ar_type=ArType.IOSAR, properties=ArProperties.DEVICE_ACCESS,
                              change=lambda blocks: blocks[:1])  # fmt: skip
        assert answer.status == 0, answer
        assert tool.write(47, changing(1004, 0x42, 77), API, 1, 1).status == 0
        assert station.device.kind.records.next_deadline() is not None

    work()
    assert tool.release().status == 0
    assert station.device.kind.records.next_deadline() is None
    work()
    station.device.cm.abort_all(RtaError.DEVICE_DEACTIVATED, line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert station.device.kind.records.next_deadline() is None
    line.run(11.0)
    assert station.store.get(1004) == before


def test_a_range_gives_each_request_its_own_time_the_same_ones_in_each_run():
    def times() -> list[float]:
        line = line_of("{parameter_latency: [20ms, 80ms], seed: 3}")
        found = []
        for _ in range(12):
            assert write(line, ASKED).ok
            due = line.farm.axes[0].device.kind.records.next_deadline()
            assert due is not None
            found.append(due - line.world.now)
            line.run(0.1)
            assert isinstance(read(line), bytes)
        return found

    first = times()
    assert first == times()
    assert len(set(first)) == 12
    assert all(0.0 < time / 1e9 < 0.081 for time in first)
    assert max(first) - min(first) > 20e6


def test_a_busy_drive_of_the_fault_catalogue_and_a_slow_one_go_together():
    line = line_of("{parameter_latency: 50ms}")
    faults = line.farm.injections
    faults.inject({"kind": "parameter-busy", "on": "all", "count": 2}, line.world.now)
    assert write(line, ASKED).ok
    assert read(line) == NOT_YET, "it works"
    line.run(0.06)
    assert read(line) == NOT_YET, "busy"
    assert read(line) == NOT_YET, "busy"
    assert isinstance(read(line), bytes)


# --- the cyclic parameter channel of the MSD --------------------------------------------------------------------


def ask(line: VirtualLine, task: Pkw, seconds: float = 0.006) -> Pkw:
    line.plc.put_parameter_task("axis-01", task)
    line.run(seconds)
    return line.plc.parameter_answer("axis-01")


def words_of(realism: str) -> VirtualLine:
    return line_of(realism, model="moog-msd", cycle="2ms", telegram=102)


def test_the_parameter_channel_says_no_response_until_the_time_is_over():
    """Moog MSD manual, table 8.18: response identifier 0."""
    line = words_of("{parameter_latency: 100ms}")
    assert ask(line, Pkw(1, 918)) == NO_TASK
    line.run(0.08)
    assert line.plc.parameter_answer("axis-01") == NO_TASK
    line.run(0.03)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=126)
    # a value that is read is kept up to date without another wait
    line.farm.axes[0].store.set("P-0918", 9)
    line.run(0.03)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=9)


def test_a_write_in_the_channel_takes_effect_once_when_its_time_is_over():
    line = words_of("{parameter_latency: 100ms}")
    store = line.farm.axes[0].store
    assert ask(line, Pkw(2, 918, value=7)) == NO_TASK
    assert store.get("P-0918") == 126
    line.run(0.1)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=7)
    store.set("P-0918", 5)
    line.run(0.5)
    assert store.get("P-0918") == 5, "the task stands and is not carried out again"


def test_a_task_that_changes_meanwhile_is_the_next_one():
    line = words_of("{parameter_latency: 100ms}")
    assert ask(line, Pkw(2, 918, value=7)) == NO_TASK
    assert ask(line, Pkw(1, 925), 0.110) in {NO_TASK, Pkw(1, 918, value=7)}
    assert line.farm.axes[0].store.get("P-0918") == 7, "what was begun is done"
    line.run(0.15)
    assert line.plc.parameter_answer("axis-01").pnu == 925


def test_the_end_of_the_connection_ends_the_task_of_the_channel():
    line = words_of("{parameter_latency: 2s}")
    station = line.farm.axes[0]
    assert ask(line, Pkw(2, 918, value=7)) == NO_TASK
    line.plc.columns.ppm["active"] = 0
    assert line.world.run(2.0, until=lambda: not station.device.ars)
    line.plc.put_parameter_task("axis-01", NO_TASK)
    line.connect()
    line.run(3.0)
    assert station.store.get("P-0918") == 126
    assert line.plc.parameter_answer("axis-01") == NO_TASK


def test_the_loss_of_the_controller_that_feeds_the_drive_ends_its_task_though_another_one_stays():
    line = SharedLine(
        """
farm: shared
link: {kind: memory}
drives:
  - {name: axis-01, model: moog-msd, ip: 10.77.0.11/23, realism: {parameter_latency: 2s}}
controller: {name: plc, ip: 10.77.1.250/23, cycle: 2ms, telegram: 102, program: {kind: idle}}
""",
        [lambda slot: slot == 0, lambda slot: slot == 1],
    )
    assert line.until(lambda: all(c.all_connected for c in line.controllers)), line.reasons()
    station = line.farm.axes[0]
    line.controllers[1].put_parameter_task("axis-01", Pkw(2, 918, value=7))
    line.run(0.05)
    assert station.device.kind.next_deadline() is not None
    line.controllers[1].columns.ppm["active"] = 0
    assert line.until(lambda: len(station.device.ars) == 1, 1.0)
    line.run(3.0)
    assert station.store.get("P-0918") == 126
