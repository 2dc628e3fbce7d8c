"""The Moog MSD in a farm at 1 ms: velocity, faults, watchdog, diagnosis alarms; sections are those of its manual."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profinet.diagnosis import diagnosis_blocks
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE
from pnfarm.table.channel import STATUS_GOOD, STATUS_NO_PROBLEM
from pnfarm.table.signals import G1_XIST1, G1_XIST2, NIST_A, NIST_B, NSOLL_A, NSOLL_B, STW2, ZSW1, ZSW2

FULL = 0x40000000  # 100 % of NSOLL_B and NIST_B (10.7)
MAXIMUM_RPM = 3000
FAULT = 0x0008


class MsdLine(VirtualLine):
    """One MSD at 1 ms; ``add`` a fault of it."""

    def __init__(self, **options) -> None:
        super().__init__(model="moog-msd", cycle="1ms", **options)
        self.faults = self.farm.injections

    def add(self, kind: str, **fields):
        return self.faults.inject({"kind": kind, "on": "all", **fields}, self.world.now)

    def until(self, condition, within: float = 5.0) -> bool:
        return self.world.run(within, until=condition)

    def seen_zsw1(self) -> int:
        return int(self.plc.columns.image[0].received[ZSW1]) & 0xFFFF

    @property
    def measures(self):
        return self.plc.sessions[0].measures


def msd(**options) -> MsdLine:
    line = MsdLine(**options)
    line.connect()
    return line


def running(**options) -> MsdLine:
    line = msd(**options)
    line.enable()
    line.run(0.5)
    return line


def axis(line):
    return line.farm.axes[0].handle.axis


def faults(line) -> list[str]:
    known = line.farm.axes[0].model.faults
    return [known[int(code) & 0xFFFFFF].label for code in axis(line).faults.code if code]


# velocity


@pytest.mark.parametrize("telegram", [1, 2, 3, 5])
def test_the_drive_runs_at_the_speed_of_its_set_point(telegram: int) -> None:
    line = running(telegram=telegram)
    assert axis(line).motor.velocity == pytest.approx(60.0, abs=0.1)
    image = line.plc.columns.image[0]
    if telegram == 1:
        assert (image.sent[NSOLL_A], image.received[NIST_A]) == (60, 60)
    else:
        assert image.sent[NSOLL_B] == round(60 / MAXIMUM_RPM * FULL)
        assert image.received[NIST_B] / FULL * MAXIMUM_RPM == pytest.approx(60.0, abs=0.1)


def test_the_sensor_of_telegram_3_counts_1048576_to_a_revolution() -> None:
    line = running(telegram=3)
    before = int(line.plc.columns.image[0].received[G1_XIST1])
    line.run(1.0)
    turned = (int(line.plc.columns.image[0].received[G1_XIST1]) - before) / 1048576
    assert turned == pytest.approx(1.0, rel=0.01)
    image = line.plc.columns.image[0]
    assert image.received[G1_XIST2] == image.received[G1_XIST1]  # 11.3.1


def test_100_percent_of_nsoll_b_is_the_maximum_speed_of_p_0338() -> None:
    line = running(telegram=2, params="{P-0338: 1500}")
    assert line.plc.columns.image[0].sent[NSOLL_B] == round(60 / 1500 * FULL)
    assert axis(line).motor.velocity == pytest.approx(60.0, abs=0.1)


@pytest.mark.parametrize("telegram", [2, 3])
def test_p_1270_moves_nothing_while_the_telegram_brings_nsoll_b(telegram: int) -> None:
    line = running(telegram=telegram)
    line.farm.axes[0].store.set("P-1270", 500)
    line.run(0.5)
    assert (axis(line).ramp.setpoint, axis(line).motor.velocity) == pytest.approx((60.0, 60.0), abs=0.1)


@pytest.mark.parametrize(("module", "direct"), [(0x1001, 1), (0x0001, 0), (0x0101, 1)])
def test_the_module_of_telegram_1_says_whether_the_ramp_generator_works(module: int, direct: int) -> None:
    """10.1: RT modules set the profile generating mode, the others the interpolating one."""
    line = MsdLine()
    (station,) = line.farm.axes
    station.store.plug_telegram(1, module)
    assert station.store.get("CON_REF_Mode") == direct
    assert station.handle.axis.ramp.settings.generator == direct
    assert (station.store.get("P-0300"), station.store.get("P-0159"), station.store.get("P-0165")) == (2, 7, 9)


def test_a_set_point_in_the_profile_generating_mode_follows_p_1278() -> None:
    line = msd(params="{P-1278: 1}")
    (station,) = line.farm.axes
    station.store.set("P-0301", 0)
    line.enable()
    # 1 rev/s2 is 60 rpm/s (13.2)
    line.run(0.5)
    assert axis(line).motor.velocity == pytest.approx(30.0, abs=3.0)
    line.run(1.0)
    assert axis(line).motor.velocity == pytest.approx(60.0, abs=0.1)


@pytest.mark.parametrize("telegram", [7, 8, 9, 101, 106, 121])
def test_without_a_task_or_a_deviation_the_axis_stands_still(telegram: int) -> None:
    line = msd(telegram=telegram)
    assert line.farm.axes[0].store.telegram_number == telegram
    line.run(1.0)
    assert line.measures.losses == 0
    assert axis(line).motor.velocity == 0.0
    assert axis(line).motor.position == 0.0


def test_a_free_mapping_brings_the_speed_in_two_words_behind_the_parameter_channel() -> None:
    """14.2: telegram 102 with the mappings of tables 14.3 and 14.4."""
    line = msd(telegram=102)
    (station,) = line.farm.axes
    line.plc.columns.program[0].enable = 0
    line.run(0.1)
    station.store.write(915, 0, [967, 1270, 1270, 1278, 1279])
    station.store.write(916, 0, [968, 1271, 1271])
    assert station.store.read(915, 0, 6) == [967, 1270, 1270, 1278, 1279, 0]
    assert [s.name if s else None for s in station.store.mapping(setpoint=True)] == [
        "PKW_HEAD", "PKW_HEAD", "PKW_VALUE", "PKW_VALUE", "STW1", "REF_SPEED", "REF_SPEED", "DRV_ACC", "DRV_DEC", None,
    ]  # fmt: skip


# faults


def test_a_fault_in_two_parts_is_raised_by_its_number_stops_the_drive_and_is_acknowledged() -> None:
    line = running()
    fault = line.add("drive-fault", params={"fault": "32-1"})
    line.run(0.05)
    assert faults(line) == ["32-1"]
    assert line.seen_zsw1() & FAULT
    store = line.farm.axes[0].store
    assert store.get("P-39") == store.get("P-0949.0") == 32 | 1 << 16
    assert (store.get("P-0945.0"), store.get("P-0947.0"), store.get("P-0951.9")) == (9, 9, 59009)
    assert line.until(lambda: fault.state == "ended", 2.0)
    line.enable()
    assert faults(line) == []


def test_the_error_memory_keeps_twenty_faults_and_a_0_clears_it() -> None:
    line = running()
    store = line.farm.axes[0].store
    for number in range(22):
        line.add("drive-fault", params={"fault": "11-1" if number % 2 else "4-1"})
        line.run(0.02)
        line.enable()
    assert store.get("P-0944") == store.get("P-0952") == 22
    # sub index 0 is the latest one, acknowledged or not
    assert store.read(949, 0, 20) == [11 | 1 << 16, 4 | 1 << 16] * 10
    assert store.read(947, 0, 20) == store.read(945, 0, 20) == [16, 4] * 10
    assert (faults(line), store.get("P-0039")) == ([], 0)
    with pytest.raises(ParameterError, match="may only be reset"):
        store.set("P-0952", 5)
    store.set("P-0952", 0)
    line.run(0.01)
    assert store.get("P-0952") == 0
    assert store.read(949, 0, 20) == [0] * 20


# watchdog and outputs


def test_without_telegrams_the_outputs_are_zero_at_once_and_32_1_comes_after_p_1283() -> None:
    line = running(params="{P-1283: 400}")
    line.add("silence", **{"for": "5s"})
    line.run(0.1)
    assert axis(line).profidrive.stw1 == 0
    assert axis(line).drive.state == 1
    assert faults(line) == []
    line.run(0.25)
    assert faults(line) == []
    line.run(0.1)
    assert faults(line) == ["32-1"]


def test_p_1283_at_0_switches_the_watchdog_off() -> None:
    line = running(params="{P-1283: 0}")
    line.add("silence", **{"for": "5s"})
    line.run(1.0)
    assert axis(line).profidrive.stw1 == 0
    assert faults(line) == []


def test_bad_outputs_are_zero_and_no_loss() -> None:
    """16: IOPS=BAD sets the outputs to zero; telegrams still come, so that the watchdog has nothing to say."""
    line = running(params="{P-1283: 100}")
    line.plc.columns.image[0].good = 0
    line.run(1.0)
    assert (axis(line).profidrive.stw1, axis(line).ramp.setpoint, axis(line).drive.state) == (0, 0.0, 1)
    assert faults(line) == []
    assert line.measures.losses == 0
    line.plc.columns.image[0].good = 1
    line.enable()


# diagnosis: 9.5.2, table 9.22; the example is ERR_ErrorID 0x0001000B, external


LAYOUTS = {
    1: "0010 0016 0001 0000 3a00 0001 0001 8000 0800 8000 8000 6800 900f",
    2: "0010 001c 0001 0000 3a00 0001 0001 8000 0800 8002 8000 6800 900f 0000 0001 000b",
    3: "0010 0018 0001 0000 3a00 0001 0002 8000 6800 0001 0001 000b 0000 0000",
}


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_fault_is_a_diagnosis_in_the_layout_of_p_1256_until_it_is_acknowledged(mode: int) -> None:
    line = running(params=f"{{P-1256: {mode}}}")
    (station,) = line.farm.axes
    line.add("drive-fault", params={"fault": "11-1"})
    line.run(0.05)
    (block,) = diagnosis_blocks(station.device.records.diagnosis, version=0x0001)
    assert block.emit().hex(" ", 2) == LAYOUTS[mode]
    (ar,) = station.device.ars.values()
    assert line.farm.columns.ppm[ar.providers[0][0]].data_status == STATUS_GOOD & ~STATUS_NO_PROBLEM
    line.run(1.0)
    assert len(station.device.records.diagnosis) == 0
    alarms = [entry.data["detail"] for entry in line.plc_log.entries("axis-01") if entry.event == "alarm"]
    subslot = 2 if mode == 3 else 1
    assert [text.split(":")[0] for text in alarms] == [
        f"diagnosis appears on slot 1 subslot 0x{subslot:04X}",
        f"diagnosis disappears on slot 1 subslot 0x{subslot:04X}",
    ]
    appears = alarms[0].split(": ", 1)[1]
    assert (
        appears
        == {
            1: "External (fault, appears)",
            2: "External (fault, value 0x1000B, appears)",
            3: "Fault of the drive (Error location 1, Error number 11, Warning state 0)",
        }[mode]
    )
    assert line.measures.alarms_received == 2
    assert [e.event for e in line.log.entries("axis-01")].count("alarm acknowledged") == 2
    assert line.farm.columns.ppm[ar.providers[0][0]].data_status == STATUS_GOOD


def test_an_error_in_the_moment_of_the_acknowledgement_takes_the_place_of_the_one_before() -> None:
    line = running(params="{P-1256: 1}")
    (station,) = line.farm.axes
    line.plc.columns.program[0].active = 0
    station.raise_fault("11-1", hold=False)
    line.run(0.05)
    assert [entry.error_type for entry in station.device.records.diagnosis] == [0x900F]
    station.handle.push_command(CMD_ACKNOWLEDGE)
    station.raise_fault("21-1", hold=False)
    line.run(0.05)
    assert faults(line) == ["21-1"]
    assert [entry.error_type for entry in station.device.records.diagnosis] == [0x900A]
    told = [entry.event for entry in line.log.entries("axis-01") if entry.event.startswith("fault")]
    assert told == ["fault", "fault acknowledged", "fault"]
    station.handle.push_command(CMD_ACKNOWLEDGE)
    line.run(0.05)
    assert len(station.device.records.diagnosis) == 0


def test_10_9_only_the_first_error_of_a_situation_is_a_diagnosis() -> None:
    line = running(params="{P-1256: 2}")
    (station,) = line.farm.axes
    for fault in ("11-1", "21-1"):
        station.raise_fault(fault, hold=False)
        line.run(0.01)
    assert [entry.ext_add_value for entry in station.device.records.diagnosis] == [11 | 1 << 16]
    assert station.fault_counts == {11 | 1 << 16: 1, 21 | 1 << 16: 1}


@pytest.mark.parametrize("mode", [0, 4, 65535])
def test_other_modes_report_nothing(mode: int) -> None:
    line = running(params=f"{{P-1256: {mode}}}")
    line.add("drive-fault", params={"fault": "11-1"})
    line.run(0.5)
    assert line.measures.alarms_received == 0
    assert len(line.farm.axes[0].device.records.diagnosis) == 0


def test_a_controller_that_comes_back_finds_the_diagnosis_of_the_loss() -> None:
    line = running(params="{P-1256: 1, P-1283: 100}")
    (station,) = line.farm.axes
    line.add("silence", **{"for": "500ms"})
    line.run(0.45)
    assert faults(line) == ["32-1"]
    assert [entry.error_type for entry in station.device.records.diagnosis] == [0x9008]
    line.connect()
    line.enable()
    assert len(station.device.records.diagnosis) == 0


def test_a_cause_that_stays_over_a_power_cycle_is_reported_again_and_ends_with_the_fault() -> None:
    line = running(params="{P-1256: 2}")
    (station,) = line.farm.axes
    fault = line.add("drive-fault", params={"fault": "11-1", "hold": True})
    line.run(0.1)
    line.add("power-cycle", params={"off": "100ms"})
    line.run(0.5)
    line.connect()
    assert faults(line) == ["11-1"]
    assert [entry.ext_add_value for entry in station.device.records.diagnosis] == [0x0001000B]
    line.faults.clear(fault.id, line.world.now)
    line.enable()
    assert len(station.device.records.diagnosis) == 0


def test_people_read_the_manuals_way_to_write_a_fault() -> None:
    line = running()
    line.add("drive-fault", params={"fault": "11-1"})
    line.run(0.5)
    seen = drive_snapshot(line.farm, line.farm.axes[0], line.world.now)
    assert seen["fault_counts"] == {"11-1": 1}
    assert seen["last_fault"]["number"] == 11 | 1 << 16


# sign of life (8.3.2)


def living(tolerance: int, telegram: int = 3) -> MsdLine:
    line = running(telegram=telegram, params=f"{{P-0925: {tolerance}}}")
    assert axis(line).life.run == 15
    return line


@pytest.mark.parametrize("telegram", [2, 3, 5])
def test_both_ends_count_with_each_telegram_and_of_bits_0_to_11_of_zsw2_only_pulses_are_shown(telegram: int) -> None:
    """Table 10.17: bit 10."""
    line = living(65535, telegram)
    counts = []
    for _ in range(31):
        line.run(0.001)
        word = int(line.plc.columns.image[0].received[ZSW2]) & 0xFFFF
        assert word & 0x0FFF == 0x0400
        counts.append((int(line.farm.columns.image[0].received[STW2]) >> 12 & 0xF, word >> 12))
    for series in zip(*counts, strict=True):
        assert [1 + n % 15 for n in series[:-1]] == list(series[1:])
    line.plc.columns.program[0].enable = 0
    line.run(0.5)
    assert not int(line.plc.columns.image[0].received[ZSW2]) & 0x0FFF


def errors(line: MsdLine, frames: int) -> list[int]:
    """P-1296 frame by frame."""
    found = []
    for _ in range(frames):
        line.run(0.001)
        found.append(line.farm.axes[0].store.get("P-1296"))
    return found


def test_p_1296_goes_up_by_ten_and_down_by_one_to_zero() -> None:
    """Figure 8.4."""
    line = living(100)
    line.plc.columns.program[0].life = 0
    standing = errors(line, 6)
    assert standing[-3:] == [standing[-1] - 20, standing[-1] - 10, standing[-1]]
    line.plc.columns.program[0].life = 1
    counting = errors(line, 100)
    top = max(counting)
    behind = counting[counting.index(top) :]
    assert behind == [max(0, top - n) for n in range(len(behind))]
    assert behind[-1] == 0
    assert faults(line) == []


def test_four_errors_with_a_limit_of_four_are_fault_32_3_and_silence_clears_the_counter() -> None:
    """Figure 8.5."""
    line = living(4)
    line.plc.columns.program[0].life = 0
    found = errors(line, 7)
    assert found[found.index(30) + 1] == 40
    line.run(0.002)
    assert faults(line) == ["32-3"]
    line.plc.columns.ppm["active"] = 0
    line.run(0.05)
    assert line.farm.axes[0].store.get("P-1296") == 0


def test_bit_4_of_p_0953_comes_with_fault_32_3_and_stays_until_cyclic_data_begin_again() -> None:
    line = living(4)
    store = line.farm.axes[0].store
    assert store.get("P-0953") == 0
    line.plc.columns.program[0].life = 0
    errors(line, 8)
    assert (faults(line), store.get("P-0953")) == (["32-3"], 0x0010)
    line.plc.columns.program[0].life = 1
    line.enable()
    line.run(0.5)
    assert (faults(line), store.get("P-1296"), store.get("P-0953")) == ([], 0, 0x0010)
    line.plc.columns.ppm["active"] = 0
    line.run(0.05)
    assert store.get("P-0953") == 0x0001, "the timeout instead"


def test_p_0953_shows_a_bus_timeout_until_telegrams_come_again() -> None:
    """Table 15.1: warnings such as bus timeout and PLC stop mode; which bits they are is assumed."""
    line = running(params="{P-1283: 0}")
    store = line.farm.axes[0].store
    assert store.get("P-0953") == 0
    line.plc.columns.ppm["active"] = 0
    line.run(0.1)
    assert (faults(line), store.get("P-0953")) == ([], 0x0001), "the watchdog that is off raises no error"
    assert line.until(lambda: line.plc.all_connected)
    line.run(0.01)
    assert store.get("P-0953") == 0


def test_a_drive_that_was_switched_off_and_on_at_once_shows_no_bus_timeout() -> None:
    line = running()
    (station,) = line.farm.stations
    station.power_cycle(line.world.now)
    line.run(0.1)
    assert not line.plc.all_connected
    assert line.farm.axes[0].store.get("P-0953") == 0


def test_p_0953_shows_that_the_watchdog_expired_before_the_connection_ended() -> None:
    line = MsdLine(params="{P-1283: 20}", watchdog=200)
    line.connect()
    line.enable()
    line.plc.columns.ppm["active"] = 0
    line.run(0.1)
    store = line.farm.axes[0].store
    assert (faults(line), store.get("P-0953")) == (["32-1"], 0x0001)
    assert line.farm.axes[0].device.watchdog_expirations == 0
    line.plc.columns.ppm["active"] = 1
    line.run(0.01)
    assert store.get("P-0953") == 0


def test_p_0953_shows_missing_telegrams_after_the_connection_was_released() -> None:
    line = running(params="{P-1283: 400}")
    store = line.farm.axes[0].store
    line.add("silence", **{"for": "5s"})
    line.run(0.1)
    assert (faults(line), store.get("P-0953")) == ([], 0)
    line.run(0.5)
    assert (faults(line), store.get("P-0953")) == (["32-1"], 0x0001)


def test_p_0953_forgets_a_bus_timeout_at_power_on() -> None:
    line = running()
    (station,) = line.farm.axes
    line.plc.columns.ppm["active"] = 0
    line.run(0.1)
    assert station.store.get("P-0953") == 0x0001
    station.station.power_cycle(line.world.now)
    line.run(0.01)
    assert station.store.get("P-0953") == 0


def test_p_0953_shows_the_stop_of_the_controller_while_it_lasts() -> None:
    line = running()
    store = line.farm.axes[0].store
    line.plc.columns.image[0].good = 0
    line.run(0.05)
    assert store.get("P-0953") == 0x0002
    line.plc.columns.image[0].good = 1
    line.run(0.05)
    assert store.get("P-0953") == 0


def test_65535_switches_it_off_which_is_the_factory_setting() -> None:
    line = running(telegram=3)
    assert line.farm.axes[0].store.get("P-0925") == 65535
    line.plc.columns.program[0].life = 0
    line.run(0.1)
    assert (faults(line), line.farm.axes[0].store.get("P-1296")) == ([], 0)
    assert line.farm.axes[0].store.get("P-0953") == 0
