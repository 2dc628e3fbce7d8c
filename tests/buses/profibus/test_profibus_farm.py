"""Drives on PROFIBUS in a farm: addresses, telegrams, lamps, diagnosis, parameters, what a PLC and a user see."""

from dataclasses import replace

import pytest

from pnfarm.drives.catalogue import model
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profibus.wire.dp import Control, Parameters, PrmStatus, SetAddress, StationStatus
from pnfarm.protocols.profibus.wire.telegram import Sap, ShortAck, Telegram, Token, emit_telegram

DP = model("moog-msd-dp")


def shown(line, name="msd-01"):
    return drive_snapshot(line.core, line.core.axis(name), line.now_ns)


def master(line):
    return line.core_of_controller()


@pytest.fixture(autouse=True)
def _controller(monkeypatch):
    """The master itself, for what the line does not offer."""
    from pnfarm.testing import Line

    monkeypatch.setattr(Line, "core_of_controller", lambda line: line._line.plc, raising=False)


def test_drives_come_into_operation_and_turn(farm):
    line = farm(3)
    line.run(1.0)
    for drive in line.drives:
        assert drive.state == "S4"
        assert drive.velocity == pytest.approx(300, abs=2)
    seen = shown(line)
    assert seen["ar_state"] == "DATA_EXCH"
    assert seen["connected"]
    assert seen["cycle_seconds"] == pytest.approx(0.005, rel=0.2)
    assert seen["watchdog_seconds"] == 0.1
    assert seen["controller"]["name"] == "master 1"
    assert seen["station_address"] == 11
    assert seen["details"]["baud"] == 1_500_000


@pytest.mark.parametrize("telegram", [1, 7, 8, 9, 101, 112, 120])
def test_each_kind_of_telegram_is_configured_by_its_identifiers(farm, telegram):
    line = farm(1, keys=f"telegram: {telegram}", running=False)
    line.wait_connected(5)
    line.run(0.2)
    assert shown(line)["telegram"] == telegram
    octets = 2 * len(DP.profidrive.telegrams[telegram].input)
    assert len(master(line).master.stations[0].inputs) == octets


def test_polls_take_as_long_as_the_octets_of_the_answer_s_form(farm):
    took = {}
    for answers in ("variable-length", "fixed-length"):
        more = f", behaviour: {{eight-octet-answers: {answers}}}"
        line = farm(more=more, keys="telegram: 106", cycle="1ms", watchdog="2s", link=", baud: 9600", running=False)
        line.wait_connected(5)
        line.run(1.0)
        took[answers] = master(line).master.cycle_ns
    # three octets of eleven bits more in front of DA
    assert took["variable-length"] - took["fixed-length"] == pytest.approx(33 * 1e9 / 9600, abs=3)


def test_telegram_1_is_the_variant_with_the_profile_generator(farm):
    assert DP.profidrive.telegrams[1].settings[301] == 0
    line = farm()
    assert line.core.axis("msd-01").store.get("P-0301") == 0


@pytest.mark.parametrize(
    ("address", "more", "expected", "source"),
    [("address: 11", "", 11, "switches"),
     ("address: 255", ", params: {P-0918: 23}", 23, "parameter"),
     ("control_unit: 45", "", 45, "parameter"),
     ("address: 7", ", params: {P-0918: 23}", 7, "switches")],
)  # fmt: skip
def test_switches_count_up_to_125_and_else_the_parameter(farm, address, more, expected, source):
    line = farm(1, address=address, more=more)
    assert (shown(line)["station_address"], shown(line)["details"]["address_from"]) == (expected, source)


@pytest.mark.parametrize(("reading", "seen"), [("in-force", 11), ("setting", 23)])
def test_a_parameter_that_the_switches_overrule_keeps_what_is_written_for_when_they_do_not(farm, reading, seen):
    line = farm(1, address="address: 11", more=f", behaviour: {{address-parameter: {reading}}}")
    station = line.core.axis("msd-01")
    station.store.set("P-0918", 23)
    assert station.store.get("P-0918") == seen
    station.store.set("P-0971", 1)
    line.run(0.1)
    line["msd-01"].power_cycle()
    line.run(0.5)
    assert (shown(line)["station_address"], station.store.get("P-0918")) == (11, seen)
    # both switches at F
    station.station.config = replace(station.station.config, switches=0xFF)
    line["msd-01"].power_cycle()
    line.run(0.5)
    assert (shown(line)["station_address"], station.store.get("P-0918")) == (23, 23)


def test_a_new_address_of_the_parameter_counts_from_the_next_power_on(farm):
    line = farm(1, address="control_unit: 23")
    station = line.core.axis("msd-01")
    station.store.set("P-0918", 24)
    station.store.set("P-0971", 1)
    line.run(0.5)
    assert shown(line)["station_address"] == 23
    line["msd-01"].power_cycle()
    line.run(1.0)
    assert shown(line)["station_address"] == 24


def test_a_master_sets_the_address_where_the_switches_leave_it_to_the_parameter(farm):
    line = farm(1, address="control_unit: 23", running=False)
    station = line.core.axis("msd-01")
    data = SetAddress(31, DP.profidrive.identity.device_id, locks=True).emit()
    station.device.receive(emit_telegram(Telegram(23, 9, 0x6D, Sap.SET_SLAVE_ADDRESS, Sap.MASTER, data)), line.now_ns)
    line.core.settle(station.station, line.now_ns)
    assert shown(line)["station_address"] == 31
    assert station.store.get("P-0918") == 31
    line["msd-01"].power_cycle()
    line.run(0.5)
    assert shown(line)["station_address"] == 31
    assert station.device.slave.address_locked


def test_the_rate_of_the_line_is_in_p_0963(farm):
    line = farm(link=", baud: 187500")
    assert line.core.axis("msd-01").store.get("P-0963") == 3
    line = farm()
    assert line.core.axis("msd-01").store.get("P-0963") == 6


@pytest.mark.parametrize("telegram", [Telegram(99, 1, 0x6D, Sap.SLAVE_DIAGNOSIS, Sap.MASTER), Token(1, 1), ShortAck()])
def test_a_line_that_lives_on_telegrams_for_others_keeps_its_rate(farm, telegram):
    line = farm()
    plc = master(line)
    plc.release(line.now_ns)
    for _ in range(120):
        plc.link.send(plc.port.index, emit_telegram(telegram))
        line.run(0.1)
    assert [entry.event for entry in line.events("seeking baud rate")] == []
    line.run(6)
    assert len(line.events("seeking baud rate")) == 1, "silence"


def lamps(line):
    return tuple(shown(line)["lamps"].values())


def test_lamps_tell_the_state(farm):
    line = farm(running=False)
    station = line.core.axis("msd-01")
    assert list(shown(line)["lamps"]) == ["H1 yellow", "H2 red", "H3 green"]
    assert lamps(line) == ("off", "off", "flashing"), "it seeks the baud rate"
    line.wait_running(5)
    assert lamps(line) == ("on", "off", "off")
    master(line).master.control(Control.CLEAR_DATA)
    line.run(0.1)
    assert lamps(line) == ("on", "off", "2 x flashes, pause")
    master(line).master.control(0)
    line.run(0.1)
    job = master(line).read_parameter("msd-01", "P-0918", line.now_ns)
    line.run(0.5)
    assert job.done
    assert lamps(line) == ("on", "off", "3 x flashes, pause")
    fault = line.inject("config-fault", on="msd-01")
    line.run(2.0)
    assert lamps(line) == ("off", "3 x flashes, pause", "off")
    fault.clear()
    fault = line.inject("wrong-ident", on="msd-01")
    line.run(1.0)
    assert lamps(line)[0] == "off"
    fault.clear()
    station.device.slave.search()
    assert lamps(line) == ("off", "flashing", "off"), "after a connection was established once"
    line["msd-01"].power_off()
    assert lamps(line) == ("off", "off", "off")


def test_a_wrong_set_prm_is_shown_by_the_red_lamp(farm):
    line = farm(running=False)
    station = line.core.axis("msd-01")
    wrong = Parameters(PrmStatus.LOCK_REQ, (1, 1), 11, 0x1234).emit()
    station.device.receive(emit_telegram(Telegram(11, 9, 0x6D, Sap.SET_PARAMETERS, Sap.MASTER, wrong)), line.now_ns)
    assert lamps(line) == ("off", "2 x flashes, pause", "off")


@pytest.mark.parametrize("mode", [0, 1, 2, 3, 9])
def test_p_1256_chooses_between_6_and_18_octets_of_diagnosis(farm, mode):
    line = farm(more=f", params: {{P-1256: {mode}}}")
    fault = line.inject("drive-fault", on="msd-01", fault="11-1", hold=True)
    line.run(0.3)
    found = master(line).master.stations[0].diagnosis
    if mode in {1, 2, 3}:
        assert found.status & StationStatus.EXT_DIAG
        # length, status type, slot, status info; location 1 and error 11; no warning (table 9.21)
        assert found.extended == bytes.fromhex("0c 81 00 00 00 01 00 0b 00 00 00 00")
    else:
        assert found.extended == b""
    fault.clear()
    line.wait_running(5)
    line.run(0.2)
    if mode in {1, 2, 3}:
        assert not master(line).master.stations[0].diagnosis.status & StationStatus.EXT_DIAG


@pytest.mark.parametrize("access", ["class-1", "class-2"])
def test_parameters_are_read_and_written_by_index_47_while_the_axis_turns(farm, access):
    line = farm(2, keys=f"access: {access}")
    written = master(line).write_parameter("msd-02", "P-1283", 4321, line.now_ns)
    line.run(0.5)
    assert (written.ok, written.error) == (True, "")
    read = master(line).read_parameter("msd-02", "P-1283", line.now_ns)
    line.run(0.5)
    assert (read.ok, read.value) == (True, 4321)
    refused = master(line).write_parameter("msd-02", "P-0968", 1, line.now_ns)
    line.run(0.5)
    assert refused.error == "error 0x01", "it cannot be changed (table 9.7)"
    assert all(drive.state == "S4" for drive in line.drives)
    connections = line.core.axis("msd-02").device.slave.class_two.open
    assert len(connections) == (1 if access == "class-2" else 0)


def test_the_manuals_schematic_an_answer_that_is_not_ready_is_refused_first(farm):
    line = farm(more=", realism: {parameter_latency: on}", cycle="1ms")
    station = line.core.axis("msd-01")
    job = master(line).read_parameter("msd-01", "P-0918", line.now_ns)
    refusals = []
    user = station.device.user
    original = user.read_record

    def read(*args):
        try:
            return original(*args)
        except Exception as exc:
            refusals.append(exc)
            raise

    user.read_record = read
    line.run(1.0)
    assert (job.ok, job.value) == (True, 11)
    assert refusals
    assert all(exc.code1 == 0xB5 for exc in refusals)


def test_the_parameter_channel_in_the_cyclic_data_answers(farm):
    from pnfarm.drives.profiles.profidrive.pkw import Pkw

    line = farm(keys="telegram: 101", running=False)
    line.wait_connected(5)
    line.run(0.1)
    # P-0918 by "request a word" (8.2.4)
    master(line).put_parameter_task("msd-01", Pkw(1, 918, 0, 0, 0))
    line.run(0.3)
    answer = master(line).parameter_answer("msd-01")
    assert (answer.identifier, answer.value) == (1, 11)


def test_a_silent_master_raises_32_1_and_zeroes_the_outputs(farm):
    line = farm()
    line.run(0.5)
    station = line.core.axis("msd-01")
    fault = line.inject("silence", on="msd-01", direction="both", **{"for": "600ms"})
    line.run(0.3)
    seen = shown(line)
    assert seen["fault"]["number"] == 1 << 16 | 32
    assert not seen["connected"]
    assert int(station.handle.image.received[0]) == 0
    assert station.store.get("P-0953") & 1, "the bus timed out"
    assert seen["watchdog_expirations"] == 1
    line.run(2.0)
    assert fault is not None
    line.wait_running(5)
    assert shown(line)["fault"] is None
    assert station.store.get("P-0953") == 0


def test_a_plc_that_stops_is_told_by_p_0953(farm):
    line = farm()
    master(line).master.control(Control.CLEAR_DATA)
    line.run(0.2)
    assert line.core.axis("msd-01").store.get("P-0953") == 2
    assert line["msd-01"].state != "S4"
    master(line).master.control(0)
    line.wait_running(5)
    assert line.core.axis("msd-01").store.get("P-0953") == 0


def test_two_drives_with_one_address_garble_each_other_and_the_rest_goes_on(farm):
    line = farm(3)
    line.core.axis("msd-02").device.slave.address = 11
    line.run(1.0)
    assert not shown(line, "msd-01")["connected"] or not shown(line, "msd-02")["connected"]
    assert shown(line, "msd-03")["connected"]


def test_a_slow_line_takes_its_time(farm):
    line = farm(4, link=", baud: 19200", keys="telegram: 120", watchdog="2s", running=False)
    line.wait_connected(10)
    line.run(2.0)
    # 77 octets there and 74 back for each drive at 19.2 kbit/s: 0.35 s for four
    assert master(line).master.cycle_ns > 300_000_000


@pytest.mark.parametrize(
    ("link", "place"),
    [("{kind: memory, baud: 10000}", "link.baud"), ("{kind: serial, pty: auto, baud: 10000}", "link.baud"),
     ("{kind: veth, lines: {profibus: {pty: auto, baud: 10000}}}", "link.lines.profibus.baud")],
)  # fmt: skip
def test_a_rate_that_profibus_lacks_is_refused_with_those_that_it_has(link, place):
    text = f"farm: dp\nlink: {link}\ndrives:\n  - {{name: a, model: moog-msd-dp, address: 5}}\n"
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text)
    assert f"{place}: 10000 bit/s is not a rate of PROFIBUS; allowed: 9600, 19200, 31250, 45450," in str(caught.value)


def test_a_line_cannot_connect_to_port_0():
    text = "farm: dp\nlink: {kind: serial, connect: 'plc:0'}\ndrives:\n  - {name: a, model: moog-msd-dp, address: 5}\n"
    with pytest.raises(FarmFileError, match=r"link\.connect: is 'plc:0', and port 0 is reserved"):
        parse_farm(text)


def test_what_the_master_says_of_its_slaves(farm):
    line = farm(2)
    row = line.controller("msd-01")
    assert (row["state"], row["ip"]) == ("data-exchange", "11")
    assert row["frames_received"] > 10
    assert any(entry.event == "connected" for entry in line.controller_events())


@pytest.mark.parametrize(("cycle", "step_ms"), [("2ms", 0.75), ("8ms", 2.0), ("40ms", 4.0)])
def test_a_drive_that_runs_by_speed_steps_four_times_in_the_master_s_cycle(farm, cycle, step_ms):
    line = farm(1, cycle=cycle, watchdog="1s")
    axis = line.core.axis("msd-01").handle.axis
    line.run(3.0)
    assert axis.step_ns == pytest.approx(step_ms * 1e6, rel=0.02)
    line.core.axis("msd-01").station.power_cycle(line.now_ns)
    assert axis.step_ns == 4_000_000


def test_a_drive_that_makes_a_curve_of_positions_keeps_the_shortest_step(farm):
    line = farm(1, cycle="8ms")
    station = line.core.axis("msd-01")
    station.handle.axis.drive.settings.opmode = 2
    line.run(1.0)
    assert station.handle.axis.step_ns == 750_000
