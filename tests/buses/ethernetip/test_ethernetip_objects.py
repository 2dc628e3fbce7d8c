"""The AKD's own CIP objects over a drive without an engine (AKD EtherNet/IP manual 6.1, 6.6, 6.7, 7, 8, 11)."""

from __future__ import annotations

from struct import pack, unpack

import pytest
from assembly_bench import ENABLE, LOAD, MOVE, PARAMETER, POSITION, REVOLUTION, SET_ATTRIBUTE, AssemblyBench, command
from from_python import called
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.buses.ethernetip.device.objects.front_tasks import FrontTasks
from pnfarm.buses.ethernetip.device.objects.parameter_object import ParameterObject
from pnfarm.buses.ethernetip.device.objects.position_controller import PositionController, Supervisor
from pnfarm.buses.ethernetip.device.objects.values import CipValues
from pnfarm.firmware.ethernetip.tasks import tells
from pnfarm.protocols.enip.status import GeneralStatus

OK = GeneralStatus.SUCCESS
OUT_OF_RANGE = 0x09
NOT_SETTABLE = 0x0E
STATE = 0x10
SHORT, LONG = 0x13, 0x15
NO_ATTRIBUTE = 0x14
NO_OBJECT = 0x16
NO_SERVICE = 0x08
FAST = {"velocity": 10 * REVOLUTION, "up": 100 * REVOLUTION, "down": 100 * REVOLUTION}


class Bench(AssemblyBench):
    """A drive with its objects; tasks of its front are carried out as the event loop does."""

    def __init__(self, mode: int = POSITION, *, homed: bool = True, latency=None) -> None:
        super().__init__(mode, homed=homed)
        self.values = CipValues(self.store)
        self.controller = PositionController(self.store, self.values)
        self.parameters = ParameterObject(self.store, self.values, self.controller.enable)
        self.supervisor = Supervisor(self.store)
        self.tasks = FrontTasks(self.store, self.values, self.parameters, self.controller, latency)

    def number(self, name: str) -> int:
        return self.store.model.resolve(name)[0].pnu

    def read(self, name: str) -> bytes:
        found = self.parameters.get(self.number(name), 1)
        assert found.status == OK, name
        return found.data

    def write(self, name: str, data: bytes) -> int:
        return int(self.parameters.set(self.number(name), 1, data).status)

    def attribute(self, number: int) -> int:
        found = self.controller.get(1, number)
        assert found.status == OK, number
        return int.from_bytes(found.data, "little", signed=True)

    def set(self, number: int, data: bytes) -> int:
        return int(self.controller.set(1, number, data).status)

    def work(self, steps: int = 1) -> None:
        for _ in range(steps):
            self.run(1)
            if called(tells)(self.axis.ethernetip, self.image, self.now):
                self.tasks.take(int(self.image.parameter_task), self.now)
            self.tasks.handle_timeout(self.now)


@pytest.fixture
def drive() -> Bench:
    return Bench()


# 0x0F


def test_7_3_every_instance_tells_value_type_and_length(drive: Bench) -> None:
    codes = {0xC2: 1, 0xC6: 1, 0xC3: 2, 0xC7: 2, 0xC4: 4, 0xC8: 4, 0xC5: 8, 0xC9: 8}
    instances = drive.store.model.cip.instances
    assert len(instances) == 666
    for number in instances:
        (code,) = drive.parameters.get(number, 5).data
        (length,) = drive.parameters.get(number, 6).data
        value = drive.parameters.get(number, 1)
        assert value.status == OK, number
        assert codes[code] == length == len(value.data), number


def test_every_writable_instance_takes_back_what_it_tells(drive: Bench) -> None:
    for number, row in drive.store.model.cip.instances.items():
        parameter = drive.store.model.parameters[number]
        if not parameter.writable or row.scaling.value == "command" or "command" in parameter.backing.name.lower():
            continue
        before = drive.parameters.get(number, 1).data
        assert drive.parameters.set(number, 1, before).status == OK, (number, parameter.name)
        assert drive.parameters.get(number, 1).data == before, (number, parameter.name)


def test_data_of_another_length_are_refused_except_32_bits_for_64(drive: Bench) -> None:
    assert drive.write("DRV.OPMODE", b"") == SHORT
    assert drive.write("DRV.OPMODE", bytes(2)) == LONG
    assert drive.write("HOME.P", pack("<i", -5)) == OK
    assert drive.read("HOME.P") == pack("<q", -5)
    assert drive.write("HOME.P", pack("<q", 1 << 36)) == OK
    assert drive.read("HOME.P") == pack("<q", 1 << 36)
    for size, status in ((0, SHORT), (3, SHORT), (5, SHORT), (7, SHORT), (9, LONG)):
        assert drive.write("HOME.P", bytes(size)) == status


def test_8_1_positions_are_in_position_units_and_keep_their_place_when_these_change(drive: Bench) -> None:
    assert drive.write("HOME.P", pack("<q", 3 * REVOLUTION)) == OK
    assert drive.axis.homing.settings.position == 3.0
    assert drive.set(4, pack("<I", 1 << 20)) == OK
    assert drive.read("HOME.P") == pack("<q", 3 << 12)
    assert drive.axis.homing.settings.position == 3.0
    assert drive.set(4, pack("<I", 1)) == OK
    assert drive.read("HOME.P") == pack("<q", 3 << 32)


def test_8_2_speeds_and_ramps_are_in_profile_units_and_are_read_as_they_were_written(drive: Bench) -> None:
    assert drive.write("DRV.ACC", pack("<q", 100 * REVOLUTION + 1)) == OK
    assert drive.read("DRV.ACC") == pack("<q", 100 * REVOLUTION + 1)
    assert drive.axis.ramp.settings.acceleration == pytest.approx(6000.0, abs=0.01)
    assert drive.set(5, pack("<I", 1 << 17)) == OK
    assert unpack("<q", drive.read("DRV.ACC"))[0] == pytest.approx(50 * REVOLUTION, abs=1)
    assert drive.axis.ramp.settings.acceleration == pytest.approx(6000.0, abs=0.01)


def test_8_3_and_8_4_currents_are_in_milliamperes_and_other_floats_times_1000(drive: Bench) -> None:
    assert drive.read("DRV.IPEAK") == pack("<i", 9000)
    assert drive.write("IL.KVFF", pack("<i", 1001)) == OK
    assert drive.store.get("IL.KVFF") == 1001


def test_limits_are_the_products_in_the_units_of_the_wire(drive: Bench) -> None:
    assert drive.write("DRV.OPMODE", b"\x03") == OUT_OF_RANGE
    assert drive.write("DRV.ACC", pack("<q", 1000)) == OUT_OF_RANGE, "below 1 rpm/s"
    assert drive.write("DRV.ACC", pack("<q", -1)) == OUT_OF_RANGE
    assert drive.write("HOME.V", pack("<q", 1 << 62)) == OUT_OF_RANGE


def test_6_1_4_errors_have_their_general_status(drive: Bench) -> None:
    assert drive.parameters.get(6, 1).status == NO_OBJECT
    assert drive.parameters.get(65001, 1).status == NO_OBJECT
    assert drive.parameters.set(6, 1, b"\0").status == NO_OBJECT
    assert drive.parameters.get(136, 2).status == NO_ATTRIBUTE
    assert drive.parameters.set(136, 2, b"\0").status == NO_ATTRIBUTE
    assert drive.parameters.set(136, 5, b"\0").status == NOT_SETTABLE
    assert drive.write("PL.FB", bytes(8)) == NOT_SETTABLE
    assert drive.write("REC.TRIG", b"\x01") == STATE
    assert drive.parameters.service(136, 0x05, b"").status == NO_SERVICE


def test_instances_are_those_of_the_appendix_and_the_class_tells_the_highest(drive: Bench) -> None:
    assert 113 in drive.parameters.instances
    assert 6 not in drive.parameters.instances
    assert drive.parameters.get(0, 2).data == pack("<H", 8195)
    assert drive.parameters.get(0, 1).data == pack("<H", 1)
    assert drive.parameters.get(0, 9).status == NO_ATTRIBUTE


@pytest.mark.parametrize("data", [b"\x01", b"\x00", b"\xff", b"\x01\x00\x00\x00"])
def test_6_6_a_command_acts_on_a_write_and_not_on_a_read(drive: Bench, data: bytes) -> None:
    drive.store.handle.push_command(1, 301)
    drive.run(3)
    assert drive.supervisor.get(1, 5).data == b"\x01"
    assert drive.read("DRV.CLRFAULTS") == b"\x00"
    drive.run(3)
    assert drive.supervisor.get(1, 5).data == b"\x01"
    assert drive.write("DRV.CLRFAULTS", data) == OK
    drive.run(3)
    assert drive.supervisor.get(1, 5).data == b"\x00"


def test_6_6_the_fault_registers_list_the_faults(drive: Bench) -> None:
    for fault in (301, 304):
        drive.store.handle.push_command(1, fault | 1 << 24)
    drive.run(3)
    size = len(drive.read("DRV.FAULT1"))
    assert [int.from_bytes(drive.parameters.get(n, 1).data, "little") for n in (478, 479, 480)] == [301, 304, 0]
    assert size in {2, 4}


def test_6_7_saving_makes_values_outlast_a_power_cycle(drive: Bench) -> None:
    assert drive.write("HOME.P", pack("<q", 77)) == OK
    drive.store.power_on()
    assert drive.read("HOME.P") == pack("<q", 0)
    assert drive.write("HOME.P", pack("<q", 77)) == OK
    assert drive.write("DRV.NVSAVE", pack("<I", 1)) == OK
    drive.store.power_on()
    assert drive.read("HOME.P") == pack("<q", 77)


def test_motion_tasks_are_edited_by_parameters_alone(drive: Bench) -> None:
    values = {"MT.NUM": b"\x05", "MT.P": pack("<q", 2 * REVOLUTION), "MT.CNTL": pack("<I", 0)}
    for name in ("MT.V", "MT.ACC", "MT.DEC"):
        values[name] = pack("<q", 100 * REVOLUTION)
    for name, data in values.items():
        assert drive.write(name, data) == OK, name
    assert drive.write("MT.SET", b"\x01") == OK
    assert drive.axis.motion_tasks.settings.position[5] == 2.0
    assert drive.axis.motion_tasks.settings.velocity[5] == pytest.approx(6000.0, abs=0.01)


# 0x24


def test_7_2_the_supervisor_tells_a_fault_and_nothing_else(drive: Bench) -> None:
    assert drive.supervisor.get(1, 5).data == b"\x00"
    assert drive.supervisor.get(1, 4).status == NO_ATTRIBUTE
    assert drive.supervisor.set(1, 5, b"\0").status == NOT_SETTABLE
    assert drive.supervisor.set(1, 4, b"\0").status == NO_ATTRIBUTE


# 0x25


def test_11_1_the_list_has_every_attribute_and_each_has_its_length(drive: Bench) -> None:
    listed = drive.controller.get(1, 2).data
    assert drive.controller.get(1, 1).data == bytes([len(listed)])
    lengths = {1: 1, 3: 1, 4: 4, 5: 4, 6: 4, 7: 4, 8: 4, 9: 4, 10: 1, 11: 1, 17: 1, 25: 4, 58: 1, 100: 2}
    assert set(listed) == {*lengths, 2, 101}
    for number, length in lengths.items():
        assert len(drive.controller.get(1, number).data) == length, number
    assert drive.controller.get(1, 101).status == NO_ATTRIBUTE, "only set"


def test_attributes_that_cannot_be_written_or_are_not_there_say_so(drive: Bench) -> None:
    for number in (1, 2, 58):
        assert drive.set(number, b"\0") == NOT_SETTABLE
    assert drive.set(12, b"\0") == NO_ATTRIBUTE
    assert drive.set(6, bytes(3)) == SHORT
    assert drive.set(6, bytes(5)) == LONG
    assert drive.controller.service(1, 1, b"").status == NO_SERVICE


@pytest.mark.parametrize(
    ("number", "data"),
    [
        (3, b"\x03"), (3, b"\x04"), (4, bytes(4)), (5, bytes(4)), (7, pack("<i", -1)), (8, pack("<i", 0)),
        (9, pack("<i", -1)), (10, b"\x02"), (11, b"\x02"), (17, b"\x02"), (25, pack("<i", 3281)),
        (25, pack("<i", -3281)), (100, pack("<h", 16)), (100, pack("<h", -1)), (101, b"\x02"),
    ],
)  # fmt: skip
def test_values_out_of_range_are_refused(drive: Bench, number: int, data: bytes) -> None:
    assert drive.set(number, data) == OUT_OF_RANGE


@pytest.mark.parametrize(("mode", "opmode"), [(0, 2), (1, 1), (2, 0)])
def test_attribute_3_numbers_the_modes_otherwise_than_drv_opmode(drive: Bench, mode: int, opmode: int) -> None:
    assert drive.set(3, bytes([mode])) == OK
    assert drive.store.get("DRV.OPMODE") == opmode
    assert drive.attribute(3) == mode


def test_attributes_8_and_9_are_the_ramps_of_the_mode(drive: Bench) -> None:
    assert drive.set(8, pack("<i", 1000 * REVOLUTION)) == OK
    assert drive.set(9, pack("<i", 500 * REVOLUTION)) == OK
    assert drive.axis.homing.settings.acceleration == pytest.approx(60_000.0)
    assert drive.axis.homing.settings.deceleration == pytest.approx(30_000.0)
    assert (drive.attribute(8), drive.attribute(9)) == (1000 * REVOLUTION, 500 * REVOLUTION)
    assert drive.set(3, b"\x01") == OK
    assert drive.set(8, pack("<i", 7 * REVOLUTION)) == OK
    assert drive.axis.ramp.settings.acceleration == pytest.approx(420.0)
    assert drive.axis.homing.settings.acceleration == pytest.approx(60_000.0)


def test_7_1_a_move_by_explicit_messages_alone(drive: Bench) -> None:
    assert drive.set(11, b"\x01") == STATE, "it is not enabled"
    assert drive.set(17, b"\x01") == OK
    drive.run(10)
    assert drive.attribute(17) == 1
    assert drive.set(6, pack("<i", 2 * REVOLUTION)) == OK
    assert drive.set(7, pack("<i", 10 * REVOLUTION)) == OK
    assert (drive.attribute(6), drive.attribute(7)) == (2 * REVOLUTION, 10 * REVOLUTION)
    assert drive.set(11, b"\x01") == OK
    drive.run(50)
    assert drive.attribute(11) == 1, "in motion"
    drive.run(1500)
    assert drive.attribute(11) == 0
    assert float(drive.axis.motor.position) == pytest.approx(2.0, abs=0.02)
    assert drive.set(10, b"\x01") == OK
    assert drive.set(6, pack("<i", -REVOLUTION)) == OK
    assert drive.set(11, b"\x01") == OK
    drive.run(1500)
    assert float(drive.axis.motor.position) == pytest.approx(1.0, abs=0.02)
    assert drive.set(17, b"\x00") == OK
    drive.run(5)
    assert drive.attribute(17) == 0


def test_7_1_torque_is_a_part_of_the_peak(drive: Bench) -> None:
    assert drive.set(3, b"\x02") == OK
    assert drive.set(17, b"\x01") == OK
    drive.run(10)
    assert drive.set(25, pack("<i", 820)) == OK
    assert drive.attribute(25) == 820
    assert drive.set(11, b"\x01") == OK
    drive.run(10)
    assert drive.attribute(25) == 820
    assert float(drive.axis.motor.current) == pytest.approx(9.0 / 4, rel=0.02)


def test_move_type_and_torque_are_as_new_behind_a_power_cycle(drive: Bench) -> None:
    assert (drive.set(10, b"\x01"), drive.set(25, pack("<i", 820))) == (OK, OK)
    assert (drive.attribute(10), drive.attribute(25)) == (1, 820)
    # as a station that boots
    drive.controller = PositionController(drive.store, drive.values)
    assert (drive.attribute(10), drive.attribute(25)) == (0, 0)


def test_6_4_2_homing_by_its_attributes() -> None:
    drive = Bench(homed=False)
    assert drive.set(101, b"\x01") == STATE, "it is not enabled"
    drive.enable()
    assert drive.set(100, pack("<h", 0)) == OK
    assert drive.set(101, b"\x00") == OK
    drive.run(20)
    assert not drive.axis.homing.homed
    assert drive.set(101, b"\x01") == OK
    drive.run(50)
    assert drive.axis.homing.homed


def test_drv_en_switches_on_as_attribute_17_does_and_drv_dis_off(drive: Bench) -> None:
    assert drive.write("DRV.EN", b"\x01") == OK
    drive.run(10)
    assert drive.attribute(17) == 1
    assert drive.write("DRV.DIS", b"\x01") == OK
    drive.run(10)
    assert drive.attribute(17) == 0
    assert drive.write("DRV.EN", b"\x01") == OK
    drive.run(10)
    assert drive.attribute(17) == 1


# tasks of the front


def test_6_2_2_7_command_0x1f_reads_and_writes_a_parameter(drive: Bench) -> None:
    drive.send(command(0, PARAMETER, data=206 | 1 << 16, value=-70000))
    drive.send(command(LOAD, PARAMETER, data=206 | 1 << 16, value=-70000), 0)
    drive.work(4)
    assert drive.second & 0x80
    assert drive.read("HOME.P") == pack("<q", -70000)
    drive.send(command(0))
    drive.send(command(LOAD, PARAMETER, data=206), 0)
    drive.work(4)
    assert drive.second & 0x80
    assert drive.long(24) == -70000


@pytest.mark.parametrize(
    ("kind", "data", "value", "error"),
    [
        (PARAMETER, 6, 0, 0x16),
        (PARAMETER, 136 | 1 << 16, 3, 0x09),
        (PARAMETER, 295 | 1 << 16, 3, 0x0E),
        (SET_ATTRIBUTE, 12, 0, 0x14),
        (SET_ATTRIBUTE, 58, 1, 0x0E),
        (SET_ATTRIBUTE, 25, 4000, 0x09),
    ],
)
def test_what_is_refused_comes_back_as_an_error_response(drive: Bench, kind, data, value, error) -> None:
    drive.send(command(0))
    drive.send(command(LOAD, kind, data=data, value=value), 0)
    drive.work(4)
    assert drive.error == (error, 0xFF)
    assert drive.response[6:8] == bytes([0x20 | kind, 0x20])


def test_6_2_2_6_command_0x1b_sets_an_attribute(drive: Bench) -> None:
    drive.send(command(0))
    drive.send(command(LOAD, SET_ATTRIBUTE, data=3, value=1), 0)
    drive.work(4)
    assert drive.second & 0x80
    assert drive.store.get("DRV.OPMODE") == 1


def test_a_slow_parameter_leaves_load_complete_open_until_it_is_done() -> None:
    drive = Bench(latency=lambda: 20_000_000)
    drive.send(command(0))
    drive.send(command(LOAD, PARAMETER, data=206), 0)
    drive.work(10)
    assert not drive.second & 0x80
    drive.work(30)
    assert drive.second & 0x80


def test_9_1_mapped_software_limits_are_written_when_they_come(drive: Bench) -> None:
    drive.store.write(drive.number("EIP.CMDMAP"), 0, [383, 384, 386])
    drive.send(command(0, map_type=2, dynamic=pack("<Hii", 3, -4 * REVOLUTION, 5 * REVOLUTION)), 0)
    drive.work(4)
    assert drive.read("SWLS.EN") == pack("<H", 3)
    assert drive.read("SWLS.LIMIT0") == pack("<q", -4 * REVOLUTION)
    assert drive.read("SWLS.LIMIT1") == pack("<q", 5 * REVOLUTION)
    assert (drive.axis.travel.settings.low, drive.axis.travel.settings.high) == (-4.0, 5.0)


def test_6_2_2_4_a_position_move_is_motion_task_0(drive: Bench) -> None:
    drive.enable()
    drive.send(command(ENABLE))
    drive.send(command(ENABLE | LOAD, MOVE, position=3 * REVOLUTION, **FAST), 0)
    drive.work(4)
    assert drive.write("MT.NUM", b"\x00") == OK
    assert drive.write("MT.LOAD", b"\x01") == OK
    assert drive.read("MT.P") == pack("<q", 3 * REVOLUTION)
    assert unpack("<q", drive.read("MT.V"))[0] == pytest.approx(10 * REVOLUTION, abs=1)


@settings(max_examples=300)
@given(st.integers(0, 9000), st.integers(0, 255), st.binary(max_size=12))
def test_any_request_gets_an_answer(instance: int, attribute: int, data: bytes) -> None:
    drive = SHARED[0] if SHARED else SHARED.append(Bench()) or SHARED[0]
    known = {status.value for status in GeneralStatus}
    for target in (drive.parameters, drive.controller, drive.supervisor):
        for answer in (
            target.get(instance, attribute),
            target.set(instance, attribute, data),
            target.set(1, attribute, data),
            target.set(instance, 1, data),
        ):
            assert answer.status in known
            assert answer.status == OK or not answer.data
    drive.run(1)


SHARED: list[Bench] = []
