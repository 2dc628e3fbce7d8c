"""The drive that is the PROFIdrive profile alone, as a slave: what a master and a PLC program see."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hand_plc import HandPlc
from profidrive_plc import ACKNOWLEDGED, FULL, MOVE, REACHED, RUN, TASK

from pnfarm.buses.profibus.description.sheet import describe_model
from pnfarm.drives.catalogue import model
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.writer import emit_gsd
from pnfarm.protocols.profibus.wire.dp import Control, StationStatus

NAME = "profidrive-dp"
DP = model(NAME)


class Slave(HandPlc):
    """The drive and a PLC at 1 ms."""

    def __init__(self, telegram: int = 1, **options) -> None:
        super().__init__(NAME, telegram, **options)
        self.station = self.plc.master.stations[0]
        self.device = self.farm.axes[0].station.device

    @property
    def fault(self) -> int:
        return int(self.axis.faults.code[0]) & 0xFFFF

    def parameter(self, name: str, value: int | None = None) -> int | None:
        """Read or written by a record."""
        now = self.world.now
        if value is None:
            job = self.plc.read_parameter("axis-01", name, now)
        else:
            job = self.plc.write_parameter("axis-01", name, value, now)
        self.world.run(1.0, until=lambda: job.done)
        assert job.ok, job.error
        return job.value


@pytest.mark.parametrize("telegram", sorted(DP.profidrive.telegrams))
def test_every_telegram_is_configured_by_the_profile_s_identifiers_and_exchanged(telegram: int):
    plc = Slave(telegram)
    frame = DP.profidrive.telegrams[telegram]
    assert plc.device.slave.user.configuration() == frame.identifiers
    assert frame.identifiers[-3:] == b"\xfd" + telegram.to_bytes(2, "big")
    assert len(plc.station.inputs) == 2 * len(frame.input)
    assert plc.store.read(922)[0] == telegram


def test_a_drive_walks_through_the_states_and_turns_at_half_of_the_reference_speed():
    plc = Slave()
    found = [plc["ZSW1"]] + [plc.put(STW1=word, NSOLL_A=FULL // 2) for word in (0x0470, 0x0476, 0x0477, RUN)]
    assert [word & 0x004F for word in found] == [0x0040, 0x0040, 0x0001, 0x0003, 0x0007]
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=10.0)


@pytest.mark.parametrize("telegram", [9, 111])
def test_a_task_of_mdi_brings_the_axis_to_its_target(telegram: int):
    plc = Slave(telegram)
    plc.put(MDI_TARPOS=50_000, MDI_VELOCITY=20_000, MDI_ACC=FULL, MDI_DEC=FULL, MDI_MOD=1, SATZANW=0x8000)
    plc.put(POS_STW1=0x8100, OVERRIDE=FULL)
    plc.switch_on(operation=TASK)
    plc.put(STW1=MOVE)
    plc.wait_for(lambda: bool(plc["ZSW1"] & ACKNOWLEDGED))
    plc.put(STW1=TASK)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc["XIST_A"] == pytest.approx(50_000, abs=20)


def test_words_of_the_farm_file_have_identifiers_of_their_lengths():
    plc = Slave(999, words="{output: [STW1, NSOLL_B], input: [ZSW1, NIST_B, MIST_GLATT]}")
    assert plc.device.slave.user.configuration() == bytes.fromhex("c3 c2 c3 fd 03 e7")
    plc.put(NSOLL_B=FULL << 15)
    plc.switch_on(operation=RUN)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc["NIST_B"] == pytest.approx(FULL << 15, rel=0.01)


@pytest.mark.parametrize("wrong", ["f1", "c3 c1 c1 fd 00 0b", "c3 c1 c1 fd 00 01 11", "00 c3 c1 c1 fd 00 01"])
def test_other_identifiers_are_refused(wrong: str):
    plc = Slave()
    plc.station.plan = replace(plc.station.plan, identifiers=bytes.fromhex(wrong))
    plc.inject("ar-abort")
    plc.wait(1000)
    assert plc.station.diagnosis.status & StationStatus.CFG_FAULT
    assert not plc.plc.all_connected


def test_without_its_master_the_watchdog_raises_fault_9_and_the_outputs_are_zero():
    plc = Slave()
    plc.put(NSOLL_A=FULL // 2)
    plc.switch_on(operation=RUN)
    plc.farm.injections.inject({"kind": "silence", "on": "all", "direction": "both", "for": "500ms"}, plc.world.now)
    plc.wait(90)
    assert (plc.fault, plc.device.connected) == (0, True)
    plc.wait(60)
    assert (plc.fault, plc.device.connected) == (9, False)
    assert not plc.farm.axes[0].handle.image.received.any()


@pytest.mark.parametrize(
    ("fault", "error"), [("8", 22), ("4", 18), ("16", 29), ("17", 30), ("2", 17), ("11", 25), ("10", 24)]
)
def test_a_fault_is_the_error_of_a_channel_with_its_class(fault: str, error: int):
    plc = Slave()
    assert plc.station.diagnosis.extended == b""
    plc.inject("drive-fault", fault=fault, hold=True)
    plc.wait(50)
    assert plc["ZSW1"] & 8
    assert plc.station.diagnosis.status & StationStatus.EXT_DIAG
    assert [block.kind for block in plc.station.diagnosis.blocks()] == ["identifier", "channel"]
    assert plc.station.diagnosis.extended == bytes((0x42, 0x01, 0x80, 0xC0, error))
    plc.clear()
    plc.put(STW1=0x0480)
    plc.wait(50)
    diagnosis = plc.station.diagnosis
    assert (diagnosis.extended, diagnosis.status & StationStatus.EXT_DIAG) == (b"", 0)


def test_a_warning_is_no_diagnosis():
    plc = Slave()
    plc.inject("drive-warning", warning="57")
    plc.wait(50)
    assert plc["ZSW1"] & 0x80
    assert plc.station.diagnosis.extended == b""


def test_clear_coasts_the_axis_and_the_connection_stays():
    plc = Slave()
    plc.put(NSOLL_A=FULL // 2)
    plc.switch_on(operation=RUN)
    plc.stop_controller()
    plc.wait(50)
    assert (plc["ZSW1"] & 4, plc.fault, plc.device.connected) == (0, 0, True)


def test_freeze_holds_the_inputs_and_sync_the_outputs():
    plc = Slave()
    plc.station.plan = replace(plc.station.plan, freeze=True, sync=True)
    plc.inject("ar-abort")
    plc.clear()
    plc.wait(1000)
    plc.put(NSOLL_A=FULL // 2)
    plc.switch_on(operation=RUN)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    plc.plc.master.control(Control.FREEZE | Control.SYNC)
    plc.wait(10)
    held = plc["NIST_A"]
    counts = plc.device.closed
    before = counts.received, counts.sent, int(counts.intervals.sum())
    plc.put(NSOLL_A=0, wait=200)
    counts = plc.device.closed
    after = counts.received, counts.sent, int(counts.intervals.sum())
    more = [new - old for new, old in zip(after, before, strict=True)]
    assert min(more) == max(more) > 10, "the telegrams count nevertheless"
    assert plc.axis.motor.velocity == pytest.approx(1500, abs=10), "the set point is held"
    plc.plc.master.control(Control.UNSYNC)
    plc.wait(300)
    assert plc.axis.motor.velocity == pytest.approx(0, abs=10)
    assert plc["NIST_A"] == held, "the actual value is held"
    plc.plc.master.control(Control.UNFREEZE)
    plc.wait(10)
    assert abs(plc["NIST_A"]) < FULL // 100 < held


def test_parameters_of_the_profile_are_read_and_written_by_records():
    plc = Slave()
    assert plc.parameter("p0918") == 11
    assert plc.parameter("p0963") == 6, "1.5 Mbit/s"
    assert plc.parameter("p0974") == 240
    assert plc.parameter("p2000") == 0x453B8000, "3000.0"
    plc.parameter("p2000", 0x44BB8000)
    plc.put(NSOLL_A=FULL // 2)
    plc.switch_on(operation=RUN)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc.axis.motor.velocity == pytest.approx(750, abs=5)


@pytest.mark.parametrize(("reading", "state"), [("hold", 4), ("coast", 1)])
def test_a_reading_chooses_what_the_profile_leaves_open(reading: str, state: int):
    plc = Slave(behaviour=f"{{control-by-plc: {reading}}}")
    plc.switch_on(operation=RUN)
    plc.put(STW1=0)
    assert int(plc.axis.drive.state) == state


def test_the_written_gsd_file_has_each_telegram():
    gsd = parse_gsd_file(emit_gsd(describe_model(DP)))
    assert (gsd.ident, gsd.family, gsd.v1, gsd.most_diagnosis) == (DP.profidrive.identity.device_id, 1, True, 11)
    assert gsd.channel_errors[22] == "Motor overload"
    for number, telegram in DP.profidrive.telegrams.items():
        slave = plug_slave(gsd, {1: number})
        assert slave.identifiers == telegram.identifiers
        assert (slave.outputs, slave.inputs) == (2 * len(telegram.output), 2 * len(telegram.input))


def test_several_axes_in_one_station_are_refused_with_a_sentence():
    drive = "{name: a, model: profidrive-dp, address: 3, axes: [{name: x}, {name: y}]}"
    with pytest.raises(FarmFileError, match="is a key of PROFINET, and this is a drive on PROFIBUS"):
        parse_farm(f"farm: x\nlink: {{kind: memory}}\ndrives:\n  - {drive}\n")
