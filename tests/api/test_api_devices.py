"""Stations, devices and their signals over HTTP."""

from __future__ import annotations

import json

import pytest
from api_world import ApiWorld, Served, assert_problem
from device_world import DeviceWorld
from plain_station import controller_sends
from slave_cell import ONE, SlaveCell

from pnfarm.api.schemas.device import DevicesView, DeviceView, SignalsAnswer, SignalsValues, StationsView

SIGNALS = "/api/v1/devices/island-1/signals"


@pytest.fixture
def world() -> DeviceWorld:
    return DeviceWorld()


@pytest.fixture(scope="module")
def still() -> DeviceWorld:
    """Where what is written does not matter."""
    return DeviceWorld()


def values(response) -> dict[str, object]:
    assert response.status_code == 200, response.text
    form = SignalsAnswer if "overruled" in response.json() else SignalsValues
    return {one.name: one.value for one in form.model_validate_json(response.content).signals}


def test_stations_are_drives_with_their_axes_and_devices(world):
    drive, device = StationsView.model_validate_json(world.get("/api/v1/stations").content).stations
    assert (drive.name, drive.kind, drive.model, drive.axes) == ("axis-01", "drive", "akd-profinet", ["axis-01"])
    assert (drive.bus, drive.description, drive.ip) == ("profinet", None, "10.77.0.11/23")
    assert (device.name, device.kind, device.model, device.axes) == ("island-1", "device", None, [])
    assert device.description == "Example island"


def test_devices_are_the_stations_without_axes(world):
    (device,) = DevicesView.model_validate_json(world.get("/api/v1/devices").content).devices
    assert device.name == "island-1"
    assert ApiWorld(1, controller=False).get("/api/v1/devices").json() == {"devices": []}


def test_a_device_shows_identity_modules_connection_and_signals(world):
    device = DeviceView.model_validate_json(world.get("/api/v1/devices/island-1").content)
    assert device.identity["vendor_id"] == 0xFFFF
    assert device.access_point == "DAP 2"
    assert [(module.slot, module.name) for module in device.modules] == [(1, "8DI"), (2, "8DO")]
    assert device.modules[0].submodules[0].input_octets == 1
    assert device.connection.state == "NO_AR"
    assert [signal.name for signal in device.signals] == ["part_present", "pressure", "code", "valve_1", "speed"]


def test_an_unknown_device_gets_a_near_name_and_a_drive_is_none(world):
    assert_problem(world.get("/api/v1/devices/island-2"), 404, "did you mean island-1?")
    assert_problem(world.get("/api/v1/devices/axis-01"), 404, "axis-01 is a drive", "devices of farm")
    assert_problem(world.get("/api/v1/drives/island-1"), 404, "island-1 is a device, not a drive")


def test_signals_have_type_unit_place_value_and_status(world):
    found = SignalsValues.model_validate_json(world.get(SIGNALS).content)
    by_name = {signal.name: signal for signal in found.signals}
    pressure = by_name["pressure"]
    assert (pressure.direction, pressure.type, pressure.unit, pressure.place) == ("input", "int16", "bar", "3.1.0")
    assert (pressure.value, pressure.good) == (0, True)
    assert (by_name["valve_1"].place, by_name["valve_1"].good) == ("2.1.0.1", False)
    assert by_name["code"].value == "00 00 00 00"


def test_written_values_are_in_force_and_in_the_log(world):
    written = world.request("PATCH", SIGNALS, json={"part_present": True, "pressure": "6.5", "code": "01ff"})
    assert values(written) == values(world.get(SIGNALS))
    assert values(written) == {
        "part_present": True, "pressure": 6.5, "code": "01 ff 00 00", "valve_1": False, "speed": 0,
    }  # fmt: skip
    (entry,) = [e for e in world.line.farm.log.entries() if e.event == "signals written by a client"]
    assert entry.drive == "island-1"
    assert entry.as_dict()["signals"] == "part_present pressure code"


def test_nothing_is_written_when_one_value_is_refused(world):
    wanted = {"part_present": True, "valve_1": True, "presure": 1, "pressure": 1e9, "code": None}
    found = assert_problem(world.request("PATCH", SIGNALS, json=wanted), 422, "the controller alone writes it")
    assert [error["field"] for error in found["errors"]] == ["valve_1", "presure", "pressure", "code"]
    assert found["errors"][1]["what"] == "is not a signal, did you mean pressure?"
    assert found["errors"][3] == {"field": "code", "what": "is nothing", "allowed": "a value of type octets[4]"}
    assert values(world.get(SIGNALS))["part_present"] is False
    assert "signals written by a client" not in {e.event for e in world.line.farm.log.entries()}


@pytest.mark.parametrize(
    "value", [[], {}, None, 10**400, 1e308, -1e308, float("nan"), float("inf"), "x", "9" * 500, "1e999", "\ud800", ""]
)
@pytest.mark.parametrize("name", ["part_present", "pressure", "code"])
def test_no_value_of_any_kind_is_a_server_error(still, name, value):
    response = still.request(
        "PATCH", SIGNALS, content=json.dumps({name: value}), headers={"Content-Type": "application/json"}
    )
    assert response.status_code in {200, 422}, response.text


def test_a_body_that_is_no_object_is_refused(world):
    assert_problem(world.request("PATCH", SIGNALS, json=[True]), 422, "not a JSON object")
    headers = {"Content-Type": "application/json"}
    assert_problem(world.request("PATCH", SIGNALS, content=b"{", headers=headers), 400, "not JSON")


def owners(response) -> dict[str, tuple[str, object]]:
    return {one["name"]: (one["owner"], one["forced"]) for one in response.json()["signals"]}


def test_a_forced_input_stays_whatever_is_written_until_it_is_released(world):
    assert {owner for owner, _ in owners(world.get(SIGNALS)).values()} == {"default", "controller"}
    tag = world.get(SIGNALS).headers["etag"]
    forced = world.request("PATCH", f"{SIGNALS}?as=force", json={"pressure": 6.5, "part_present": "on"})
    assert (values(forced)["pressure"], forced.json()["overruled"]) == (6.5, {})
    assert owners(forced)["pressure"] == ("force", 6.5)
    assert forced.headers["etag"] != tag
    written = world.request("PATCH", SIGNALS, json={"pressure": 1, "code": "01"})
    assert written.json()["overruled"] == {"pressure": "force"}
    assert values(written)["pressure"] == 6.5
    assert owners(written)["code"] == ("value", None)
    released = world.request("PATCH", f"{SIGNALS}?as=force", json={"pressure": None})
    assert values(released)["pressure"] == 1
    assert owners(released) == {
        "pressure": ("value", None), "part_present": ("force", True), "code": ("value", None),
        "valve_1": ("controller", None), "speed": ("controller", None),
    }  # fmt: skip
    every = world.request("PATCH", f"{SIGNALS}?as=force", json={"*": None, "pressure": 3})
    assert owners(every)["part_present"] == ("default", None)
    assert owners(every)["pressure"] == ("force", 3)
    entries = [e for e in world.line.farm.log.entries() if e.event == "signals forced by a client"]
    assert [entry.as_dict()["signals"] for entry in entries] == ["pressure part_present", "pressure", "* pressure"]


def test_nothing_is_forced_when_one_value_is_refused(world):
    wanted = {"part_present": True, "valve_1": True, "presure": 1, "pressure": 1e9, "*": True}
    found = assert_problem(world.request("PATCH", f"{SIGNALS}?as=force", json=wanted), 422, "the controller alone")
    assert [error["field"] for error in found["errors"]] == ["valve_1", "presure", "pressure", "*"]
    assert world.request("PATCH", f"{SIGNALS}?as=force", json={"valve_1": None}).status_code == 200
    assert_problem(world.request("PATCH", f"{SIGNALS}?as=force", json={"valv_1": None}), 422, "did you mean valve_1?")
    assert_problem(world.request("PATCH", f"{SIGNALS}?as=stone", json={"pressure": 1}), 422, "as")
    assert not world.signals.forced


def test_a_write_on_what_has_changed_since_is_refused(world):
    tag = world.get(SIGNALS).headers["etag"]
    first = world.request("PATCH", SIGNALS, json={"pressure": 1.0}, headers={"If-Match": tag})
    assert values(first)["pressure"] == 1.0
    late = world.request("PATCH", SIGNALS, json={"pressure": 2.0}, headers={"If-Match": tag})
    assert_problem(late, 412, "has changed since", "read it again")
    assert values(world.get(SIGNALS))["pressure"] == 1.0
    again = world.request("PATCH", SIGNALS, json={"pressure": 2.0}, headers={"If-Match": first.headers["etag"]})
    assert values(again)["pressure"] == 2.0
    assert world.request("PATCH", SIGNALS, json={}, headers={"If-Match": "*"}).status_code == 200


def test_what_the_client_knows_is_not_sent_again(world):
    tag = world.get(SIGNALS).headers["etag"]
    known = world.get(SIGNALS, headers={"If-None-Match": tag})
    assert (known.status_code, known.content, known.headers["etag"]) == (304, b"", tag)
    controller_sends(world.signals, b"\x02\0\0")
    fresh = world.get(SIGNALS, headers={"If-None-Match": tag})
    assert values(fresh)["valve_1"] is True
    assert fresh.headers["etag"] != tag


def test_numbers_that_json_lacks_are_texts():
    world = DeviceWorld(more={"level": {"at": "3.1.2", "type": "float32"}})
    assert values(world.request("PATCH", SIGNALS, json={"level": "nan"}))["level"] == "nan"
    assert values(world.request("PATCH", SIGNALS, json={"level": "inf"}))["level"] == "inf"


def test_a_device_without_data_has_no_signals(world):
    world.device.signals = None
    assert_problem(world.get(SIGNALS), 404, "device island-1 has no signals")
    assert world.get("/api/v1/devices/island-1").json()["signals"] == []


def test_the_description_names_the_conditions(world):
    paths = world.get("/openapi.json").json()["paths"]
    patch = paths["/api/v1/devices/{name}/signals"]["patch"]
    assert {"200", "401", "403", "404", "412", "422"} <= patch["responses"].keys()
    assert "ETag" in patch["responses"]["200"]["headers"]


def test_a_device_on_a_serial_line_is_shown_and_its_signals_reach_the_master():
    cell = SlaveCell(ONE)
    cell.connect()
    world = Served(cell)
    device = DeviceView.model_validate_json(world.get("/api/v1/devices/island").content)
    assert (device.description, device.identity["ident_number"], device.identity["vendor"]) == (
        "Island DP", 0x1D01, "Example Maker",
    )  # fmt: skip
    assert [(module.slot, module.name) for module in device.modules] == [(1, "16DI"), (2, "8DO"), (4, "Counter")]
    assert (device.connection.state, device.ip, device.mac) == ("DATA_EXCH", None, "")
    answer = world.request("PATCH", "/api/v1/devices/island/signals", json={"part_present": True})
    assert answer.status_code == 200, answer.text
    cell.world.run(0.1)
    assert cell.inputs() == (bytes.fromhex("0800000000000000"), True)


def test_readiness_is_as_described_and_has_one_entry_for_each_station(world):
    found = world.get("/api/v1/readiness").json()
    assert [(one["name"], one["state"], one["visits"]) for one in found["stations"]] == [
        ("axis-01", "unseen", []),
        ("island-1", "unseen", []),
    ]
    assert (found["ready"], found["controllers"], found["missing"]) == (False, [], [])
