"""Every row of every model: what one test says of all of them; each runs the drive's own firmware."""

from __future__ import annotations

import pytest
from drives_kit import Drive, new_drive

from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.parts import Fault
from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults, fault_situations
from pnfarm.drives.profiles.profidrive.part import PROFIDRIVE
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    CMD_CLEAR_WARNING,
    CMD_POWER_ON,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    FAULT_WORDS,
    REACTION_QUICK_STOP,
)
from pnfarm.table.image import LOST_NOT
from pnfarm.table.signals import FAULT_CODE, STW1, WARN_CODE, ZSW1

MS = 1_000_000
ENABLE = (0x0476, 0x0477, 0x047F)
ACKNOWLEDGE = 0x04F6
STAND_STILL = 0x0476


class Running:
    """A drive with its firmware, in operation under a controller."""

    def __init__(self, name: str) -> None:
        self.drive: Drive = new_drive(name)
        self.axis, self.image, self.store = self.drive.axis, self.drive.image, self.drive.store
        self.now = 1_000 * MS
        self.axis.last_ns, self.axis.powered = self.now, 1
        self.axis.step_ns = MS
        self.store.handle.push_command(CMD_POWER_ON)
        self.run(200)
        self.enable()

    def run(self, milliseconds: int) -> None:
        self.now = self.drive.pass_time(self.now, milliseconds)

    def put(self, word: int, milliseconds: int = 5) -> None:
        self.image.valid, self.image.lost = 1, LOST_NOT
        self.image.received[STW1] = word
        self.run(milliseconds)

    def enable(self) -> None:
        for word in ENABLE:
            self.put(word)
        assert self.axis.drive.state == 4

    def value(self, argument: str) -> list[list[int]]:
        """The elements of every parameter that a function computes."""
        rows = [p for p in self.drive.model.parameters.values() if p.argument == argument]
        return [self.store.read(row.pnu, 0, max(row.elements, 1)) for row in rows]

    @property
    def zsw1(self) -> int:
        return int(self.image.sent[ZSW1]) & 0xFFFF


@pytest.fixture(params=sorted(name for name in models() if model(name).profile == PROFIDRIVE))
def running(request: pytest.FixtureRequest) -> Running:
    return Running(request.param)


def faults_of(running: Running) -> list[Fault]:
    return [fault for fault in running.drive.model.faults.values() if not fault.warning]


def test_each_fault_stops_the_drive_as_its_row_says_is_read_back_and_acknowledged(running: Running) -> None:
    """ZSW1.3, the fault words, the drive's own list of active faults and its fault buffer."""
    rows = faults_of(running)
    assert rows
    for fault in rows:
        counted = running.value("fault-counter")
        running.axis.motor.velocity = 500.0
        running.store.handle.push_command(CMD_RAISE_FAULT, fault.code)
        running.run(1)
        # a quick stop brakes with the power stage on, coasting is without it
        braking = fault.reaction == REACTION_QUICK_STOP
        assert (int(running.axis.drive.state) == 5) is braking, fault
        assert (int(running.axis.drive.state) <= 1) is not braking, fault
        running.run(2000)
        assert int(running.axis.drive.state) <= 1, fault
        assert running.zsw1 & 0x0008, fault
        assert active_faults(running.axis) == [fault.number]
        assert fault_situations(running.axis)[0] == [fault.number]
        shown = fault.word if fault.number < FAULT_WORDS else fault.number & 0xFFFF
        assert int(running.image.sent[FAULT_CODE]) & 0xFFFF == shown
        assert all(values[0] == fault.number for values in running.value("fault-buffer")), fault
        assert all(values == [fault.number] for values in running.value("fault")[:1]), fault
        assert all(values[0] == shown for values in running.value("fault-codes")), fault
        assert all(values[0] for values in running.value("fault-classes")), fault
        assert all(now != before for now, before in zip(running.value("fault-counter"), counted, strict=True))
        running.put(STAND_STILL)
        running.put(ACKNOWLEDGE)
        assert active_faults(running.axis) == [], fault
        assert not running.zsw1 & 0x0008, fault
        running.put(STAND_STILL)
        running.axis.motor.velocity = 0.0
        running.enable()


def test_each_warning_shows_and_goes_and_leaves_the_drive_running(running: Running) -> None:
    """ZSW1.7 and the drive's own warning."""
    for fault in (fault for fault in running.drive.model.faults.values() if fault.warning):
        running.store.handle.push_command(CMD_RAISE_WARNING, fault.number)
        running.run(2)
        assert running.zsw1 & 0x0080, fault
        assert int(running.image.sent[WARN_CODE]) == fault.number & 0xFFFF
        assert all(values == [fault.number] for values in running.value("warning")[:1]), fault
        assert running.axis.drive.state == 4
        running.store.handle.push_command(CMD_CLEAR_WARNING, fault.number)
        running.run(2)
        assert not running.zsw1 & 0x0080, fault


def stored_arrays(drive: Drive) -> list[Parameter]:
    kinds = {Backing.STORED, Backing.FIELD}
    return [p for p in drive.model.parameters.values() if p.writable and p.elements and p.backing in kinds]


def test_each_element_of_a_writable_array_takes_its_limits_and_refuses_what_lies_beyond(drive: Drive) -> None:
    for parameter in stored_arrays(drive):
        for place in (0, parameter.elements - 1):
            for value in (parameter.minimum, parameter.maximum):
                drive.store.write(parameter.pnu, place, [value])
                assert drive.store.read(parameter.pnu, place) == [value], parameter
            for value in (parameter.minimum - 1, parameter.maximum + 1):
                with pytest.raises(ParameterError) as caught:
                    drive.store.write(parameter.pnu, place, [value])
                assert (caught.value.number, caught.value.value) == (ParameterErrorNumber.LIMIT_EXCEEDED, place)
        with pytest.raises(ParameterError) as caught:
            drive.store.write(parameter.pnu, parameter.elements, [parameter.minimum])
        assert caught.value.number == ParameterErrorNumber.FAULTY_SUBINDEX


@pytest.mark.parametrize("name", sorted(models()))
def test_a_model_is_printed_with_every_row_and_its_source(name: str) -> None:
    """``pnfarm models MODEL --format json``: parameters, signals, faults, telegrams and facts, each with its source."""
    described, found = model(name), as_json(model(name))
    assert [row["pnu"] for row in found["parameters"]] == list(described.parameters)
    assert [row["number"] for row in found["signals"]] == list(described.profidrive.signals)
    assert [row["number"] for row in found["faults"]] == list(described.faults)
    assert [row["number"] for row in found["telegrams"]] == list(described.profidrive.telegrams)
    for section in ("parameters", "signals", "faults", "telegrams", "bits"):
        assert all(row["source"] for row in found[section]), section
    for key, fact in described.facts.items():
        section, *parts = key.split(".")
        part = found["bus_facts" if section == described.bus else section]
        shown = part.get("sources", part)
        if section == "motors":
            kind, of, *parts = parts
            shown = shown[kind][of]
        shown = shown[".".join(parts)]
        assert (shown["source"], shown["note"]) == (fact.source, fact.note), key


def test_what_a_parameter_is_told_to_count_in_is_its_own_unit_and_not_the_axiss(drive: Drive) -> None:
    """A factor that leads on to what the firmware counts in comes after the one to the unit."""
    for parameter in drive.model.parameters.values():
        assert parameter.standardisation > 0.0, parameter
        if parameter.backing is Backing.FIELD and parameter.factor == parameter.standardisation != 1.0:
            assert parameter.unit == AXIS.fields[parameter.argument].unit, parameter
