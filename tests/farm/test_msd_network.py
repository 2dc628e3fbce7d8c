"""What the Moog MSD shows of its network: P-1289 to P-1292 and P-1295, and lamps; sections are those of its manual."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL, ParameterChannel
from pnfarm.farm.views.snapshot import drive_snapshot


@pytest.fixture
def line() -> VirtualLine:
    return VirtualLine(model="moog-msd", cycle="2ms")


def name_of(line: VirtualLine) -> str:
    return bytes(line.farm.axes[0].store.read(1289, 0, 234)).rstrip(b"\0").decode()


def write_name(line: VirtualLine, name: str) -> None:
    line.farm.axes[0].store.write(1289, 0, list(name.encode().ljust(234, b"\0")))


def set_by_dcp(line: VirtualLine, name: str) -> None:
    line.plc.dcp.set_name(line.farm.axes[0].port.mac, name, now=line.world.now)
    line.run(0.1)
    assert line.farm.axes[0].device.name == name


def test_name_and_addresses_are_those_in_force(line):
    """15, table 15.1."""
    (station,) = line.farm.axes
    assert name_of(line) == "axis-01"
    assert [station.store.get(f"P-{n}") for n in (1290, 1291, 1295)] == [0x0A4D000B, 0xFFFFFE00, 0]
    assert bytes(station.store.read(1292, 0, 18)) == station.port.mac * 3
    set_by_dcp(line, "other")
    assert name_of(line) == "other"


def test_a_station_without_a_name_shows_the_factorys(line):
    """15: default DRIVE, P-1289 and P-1293; addresses are 0."""
    (station,) = line.farm.axes
    set_by_dcp(line, "")
    assert name_of(line) == "DRIVE"
    assert bytes(station.store.read(1293, 0, 25)).rstrip(b"\0") == b"DRIVE"


def changed(line: VirtualLine) -> tuple[bool, bool]:
    """Whether P-1289 is reported to differ from the factory's, by bit 12 of its description and by P-0990."""
    (station,) = line.farm.axes
    request = ParameterChannel(station.store, LOCAL)
    request.write_request(bytes.fromhex("07 01 00 01 20 01 05 09 00 01"))
    identifier = int.from_bytes((request.read_response() or b"")[6:8], "big")
    return bool(identifier & 0x1000), 1289 in station.store.read(990, 0, 117)


def test_a_name_differs_from_the_factorys_whoever_gave_it(line):
    """Table 8.16, bit 12, and table 15.1, P-0990."""
    assert changed(line) == (True, True)
    set_by_dcp(line, "")
    assert changed(line) == (False, False)
    write_name(line, "press-7")
    assert changed(line) == (True, True)
    write_name(line, "")
    assert (name_of(line), changed(line)) == ("DRIVE", (False, False))


def test_the_factory_setting_of_the_name_can_be_written_and_is_no_name(line):
    """15, table 15.1: P-1289 takes what it has by default; no station has capitals in its name."""
    (station,) = line.farm.axes
    write_name(line, "DRIVE")
    assert (name_of(line), station.device.name, changed(line)) == ("DRIVE", "axis-01", (False, False))
    station.store.set("P-0971", 1)
    line.run(0.01)
    station.station.power_cycle(line.world.now)
    assert (name_of(line), station.device.name) == ("DRIVE", "")


def test_a_name_that_is_written_and_saved_counts_from_the_next_power_on(line):
    """15: P-1289 can be changed."""
    (station,) = line.farm.axes
    write_name(line, "press-7")
    assert (name_of(line), station.device.name) == ("press-7", "axis-01")
    station.store.set("P-0971", 1)
    line.run(0.01)
    station.station.power_cycle(line.world.now)
    assert (name_of(line), station.device.name) == ("press-7", "press-7")
    # it is the station's now: what DCP sets later is not undone by the next power-on
    set_by_dcp(line, "press-8")
    station.station.power_cycle(line.world.now)
    assert (name_of(line), station.device.name) == ("press-8", "press-8")


def test_a_name_that_is_not_saved_is_lost_at_power_on(line):
    (station,) = line.farm.axes
    write_name(line, "press-7")
    station.station.power_cycle(line.world.now)
    assert (name_of(line), station.device.name) == ("axis-01", "axis-01")


@pytest.mark.parametrize("name", ["Press", "press_7", "-press", "10.0.0.1", "a" * 64, "ä"])
def test_a_name_that_no_station_may_have_is_refused(line, name):
    with pytest.raises(ParameterError) as caught:
        write_name(line, name)
    assert caught.value.number == ParameterErrorNumber.VALUE_IMPERMISSIBLE
    assert name_of(line) == "axis-01"


def lamps(line: VirtualLine) -> tuple[str, ...]:
    return tuple(drive_snapshot(line.farm, line.farm.axes[0], line.world.now)["lamps"].values())


def test_lamps_are_lit_as_in_table_5_2(line):
    """5.2.1: H16 red and H17 green."""
    (station,) = line.farm.axes
    line.run(0.001)
    shown = drive_snapshot(line.farm, station, line.world.now)["lamps"]
    assert shown == {"H16 red": "on", "H17 green": "off"}  # device test and initialisation
    line.connect()
    assert lamps(line) == ("off", "on, interrupted for 0.5 s")
    line.plc.dcp.signal(station.port.mac, now=line.world.now)
    line.run(0.1)
    assert lamps(line) == ("1 s on, 1 s off",) * 2
    line.run(3.0)
    line.plc.release(line.world.now)
    line.run(0.1)
    assert lamps(line) == ("on", "on")  # ready, no cyclic data
    station.station.power_off(line.world.now)
    assert lamps(line) == ("off", "off")


def test_a_model_whose_manual_names_no_lamps_shows_none():
    line = VirtualLine(model="akd-profinet", controller=False)
    assert lamps(line) == ()
