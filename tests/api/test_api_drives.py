"""Drives and their parameters over HTTP."""

from __future__ import annotations

import asyncio

import pytest
from api_world import ApiWorld, assert_problem
from events import Something

from pnfarm.api.events import event_stream
from pnfarm.api.paths.drives import DriveSignals, ParameterValue
from pnfarm.api.schemas.drive import Drive
from pnfarm.api.schemas.farm import FarmView
from pnfarm.drives.parameters.parameter import ParameterErrorNumber


@pytest.fixture(scope="module")
def still() -> ApiWorld:
    """Two drives without a controller."""
    world = ApiWorld(2, controller=False)
    world.line.run(0.5)
    return world


def test_list_of_drives_shows_farm_engine_and_every_drive(still):
    response = still.get("/api/v1/drives")
    assert response.status_code == 200
    view = FarmView.model_validate_json(response.content)
    assert [drive.name for drive in view.drives] == ["axis-01", "axis-02"]
    assert view.engine.cycles > 0
    assert view.lines == []
    assert view.drives[0].ar_state == "NO_AR"
    assert view.drives[0].controller is None


def test_running_drive_shows_state_controller_and_frames():
    world = ApiWorld(1)
    world.line.connect()
    world.line.enable()
    world.line.run(0.5)
    drive = Drive.model_validate_json(world.get("/api/v1/drives/axis-01").content)
    assert (drive.state, drive.ar_state, drive.telegram) == ("S4", "DATA", 1)
    assert drive.controller is not None
    assert (drive.controller.name, drive.controller.ip) == ("plc", "10.77.1.250")
    assert (drive.cycle_seconds, drive.watchdog_seconds) == (0.016, 0.048)
    assert "operation_enabled" in drive.zsw1_bits
    assert "enable_operation" in drive.stw1_bits
    assert drive.velocity_rpm == pytest.approx(60, abs=0.3)
    assert drive.frames_sent > 30 < drive.frames_received


def test_a_drive_shows_what_was_agreed_and_what_is_where_in_its_frames():
    world = ApiWorld(1)
    world.line.connect()
    world.line.run(0.2)
    (agreed,) = world.get("/api/v1/drives/axis-01").json()["details"]["connections"]
    assert (agreed["ar_type"], agreed["state"]) == ("IO controller", "DATA")
    directions = {channel["direction"]: channel for channel in agreed["channels"]}
    assert set(directions) == {"sent", "received"}
    assert directions["sent"]["id"] != directions["received"]["id"]
    for channel in agreed["channels"]:
        places = [
            octet for place in channel["places"] for octet in range(place["offset"], place["offset"] + place["octets"])
        ]
        assert places == sorted(set(places))
        assert places[-1] < channel["octets"]
        assert sum(place["octets"] for place in channel["places"] if place["what"] == "data") == 4
        cycles = channel["send_clock_factor"] * channel["reduction_ratio"] * 31.25e-6
        assert channel["cycle_seconds"] == pytest.approx(cycles)
    assert directions["received"]["timeout_seconds"] > directions["received"]["cycle_seconds"]


def test_a_drive_shows_its_last_events():
    world = ApiWorld(2)
    world.line.connect()
    events = Drive.model_validate_json(world.get("/api/v1/drives/axis-01").content).events
    assert {event.drive for event in events} == {"axis-01"}
    assert [event.event for event in events if event.event.startswith("ar ")] == [
        "ar connected",
        "ar established",
    ]
    drives = world.get("/api/v1/drives").json()["drives"]
    assert [(drive["name"], drive.get("events", [])) for drive in drives] == [("axis-01", []), ("axis-02", [])]


def test_a_drives_stream_begins_with_what_its_own_ring_kept():
    world = ApiWorld(2)
    world.line.connect()
    log = world.line.farm.log
    for _ in range(5000):
        log.record(0, "axis-02", Something("noise"))
    log.record(0, "axis-01", Something("news"))

    async def first(count: int) -> str:
        stream = event_stream(world.context, 0, "axis-01")
        try:
            return "".join([await anext(stream) for _ in range(count)])
        finally:
            await stream.aclose()

    told = asyncio.run(first(4))
    assert told.index('"ar connected"') < told.index('"lost":') < told.index('"news"')
    assert "noise" not in told


def test_fault_of_a_drive_is_active_first_and_the_last_one_afterwards():
    world = ApiWorld(1)
    world.line.connect()
    world.line.enable()
    world.line.farm.axis("axis-01").raise_fault(702, hold=False)
    world.line.run(0.05)
    drive = world.get("/api/v1/drives/axis-01").json()
    lost = {"number": 702, "name": "Fieldbus communication lost"}
    assert drive["fault"] == drive["last_fault"] == lost
    assert "fault_present" in drive["zsw1_bits"]
    world.line.run(2.0)
    drive = world.get("/api/v1/drives/axis-01").json()
    assert drive["fault"] is None
    assert drive["last_fault"] == lost
    assert drive["fault_counts"] == {"702": 1}


def test_signals_of_a_drive_have_the_names_of_conditions_and_their_values(still):
    axis = still.line.farm.axes[0].handle.axis
    axis.faults.code[0] = 702
    try:
        response = still.get("/api/v1/drives/axis-01/signals")
    finally:
        axis.faults.code[0] = 0
    view = DriveSignals.model_validate_json(response.content)
    found = {signal.name: (signal.type, signal.value, signal.shown, signal.unit) for signal in view.signals}
    assert (response.status_code, view.drive) == (200, "axis-01")
    assert found["fault"] == ("fault", 702, "702", "")
    assert found["faulted"] == ("bit", True, "true", "")
    assert found["state"] == ("state", "S1", "S1", "")
    assert found["bus_voltage"] == ("number", 560.0, "560", "V")
    assert found["stw1"] == ("word", 0, "0x0000", "")
    assert found["stw1.on"] == ("bit", False, "false", "")
    assert_problem(still.get("/api/v1/drives/axis-09/signals"), 404)


def test_unknown_drive_is_a_problem_that_says_so(still):
    found = assert_problem(still.get("/api/v1/drives/axis-09"), 404, "axis-09", "pnfarm inspect")
    assert found["instance"] == "/api/v1/drives/axis-09"


@pytest.mark.parametrize("wanted", ["DRV.OPMODE", "drv.opmode", "DRV%2EOPMODE"])
def test_parameter_by_the_manuals_name(still, wanted):
    value = ParameterValue.model_validate_json(still.get(f"/api/v1/drives/axis-01/params/{wanted}").content)
    assert value.name == "DRV.OPMODE"
    by_number = still.get(f"/api/v1/drives/axis-01/params/{value.pnu}").json()
    assert by_number["value"] == value.value


def test_parameter_whose_name_has_blanks(still):
    response = still.get("/api/v1/drives/axis-01/params/Telegram%20selection")
    assert response.json()["pnu"] == 922


def test_array_gives_all_elements_and_one_by_its_subindex(still):
    whole = still.get("/api/v1/drives/axis-01/params/964").json()
    assert whole["value"] == whole["values"][0]
    second = still.get("/api/v1/drives/axis-01/params/964.1").json()
    assert (second["subindex"], second["value"]) == (1, whole["values"][1])


def test_written_parameter_is_read_back_and_in_force():
    world = ApiWorld(1, controller=False)
    world.line.run(0.2)
    path = "/api/v1/drives/axis-01/params/DRV.OPMODE"
    written = world.put(path, {"value": 2})
    assert written.status_code == 200
    assert written.json()["value"] == 2
    assert world.get(path).json()["changed"] is True
    assert world.line.farm.columns.axis[0].drive.settings.opmode == 2


@pytest.mark.parametrize(
    ("pnu", "value", "status", "number"),
    [
        ("DRV.OPMODE", 99, 422, ParameterErrorNumber.LIMIT_EXCEEDED),
        ("VL.FB", 1, 409, ParameterErrorNumber.NOT_CHANGEABLE),
        ("60000", 1, 404, ParameterErrorNumber.IMPERMISSIBLE_PNU),
        ("No.Such", 1, 404, ParameterErrorNumber.IMPERMISSIBLE_PNU),
        ("a/b", 1, 404, ParameterErrorNumber.IMPERMISSIBLE_PNU),
        ("964.99", 1, 409, ParameterErrorNumber.NOT_CHANGEABLE),
    ],
)
def test_refused_write_carries_profidrives_error_number_and_words(still, pnu, value, status, number):
    found = assert_problem(still.put(f"/api/v1/drives/axis-01/params/{pnu}", {"value": value}), status, number.words)
    assert found["error_number"] == number


@pytest.mark.parametrize("pnu", ["65536", "9" * 5000, "964." + "9" * 5000, "DRV.OPMODE." + "9" * 5000])
def test_a_parameter_number_of_any_length_is_not_found(still, pnu):
    found = assert_problem(still.get(f"/api/v1/drives/axis-01/params/{pnu}"), 404)
    assert len(found["detail"]) < 200


def test_element_beyond_an_array_is_not_found(still):
    found = assert_problem(still.get("/api/v1/drives/axis-01/params/964.99"), 404, "faulty subindex")
    assert found["error_number"] == 3


@pytest.mark.parametrize(
    "body", [{}, {"value": "1"}, {"value": 1.5}, {"value": True}, {"value": 1, "more": 2}, {"value": None}]
)
def test_body_that_is_no_value_says_what_would_be_right(still, body):
    found = assert_problem(
        still.put("/api/v1/drives/axis-01/params/DRV.OPMODE", body), 422, '{"value": a whole number}'
    )
    assert found["errors"]


@pytest.mark.parametrize(
    ("content", "kind", "status", "word"),
    [
        (b"{", "application/json", 400, "not JSON"),
        (b"\xff", "application/json", 400, "not JSON"),
        (b"[" * 100_000, "application/json", 413, "octets"),
        (b"[" * 60_000, "application/json", 400, ""),
        (b'{"value":' + b"1" * 5000 + b"}", "application/json", 400, "not JSON"),
        (b"[1]", "application/json", 422, "JSON object"),
        (b'{"value": 1}', "text/plain", 415, "application/json"),
        (b"", "application/json", 400, "not JSON"),
    ],
)
def test_body_that_cannot_be_read_is_a_problem(still, content, kind, status, word):
    response = still.request(
        "PUT", "/api/v1/drives/axis-01/params/DRV.OPMODE", content=content, headers={"Content-Type": kind}
    )
    assert_problem(response, status, word)


def test_power_cycle_boots_the_drive_and_ends_its_connection():
    world = ApiWorld(2)
    world.line.connect()
    answer = world.post("/api/v1/drives/axis-01/power-cycle")
    assert answer.status_code == 200
    world.line.run(0.01)
    drive = world.get("/api/v1/drives/axis-01").json()
    assert (drive["state"], drive["ar_state"], drive["connected"]) == ("boot", "NO_AR", False)
    other = world.get("/api/v1/drives/axis-02").json()
    assert (other["ar_state"], other["connected"]) == ("DATA", True)
    assert "power off" in world.line.events("axis-01")
    assert world.line.world.run(5.0, until=lambda: world.line.farm.axis("axis-01").device.connects == 2)


def test_switched_off_drive_has_no_parameters_to_give():
    world = ApiWorld(1, controller=False)
    world.line.farm.axis("axis-01").station.power_off(world.line.world.now)
    assert world.get("/api/v1/drives/axis-01").json()["state"] == "off"
    assert_problem(world.get("/api/v1/drives/axis-01/params/DRV.OPMODE"), 409, "axis-01 is switched off")


def test_drive_is_found_by_the_name_that_dcp_gave_it():
    world = ApiWorld(1, controller=False)
    world.line.farm.axis("axis-01").device.dcp.name = "press-left"
    drive = world.get("/api/v1/drives/press-left").json()
    assert (drive["name"], drive["station_name"]) == ("axis-01", "press-left")


def test_looking_changes_nothing():
    world = ApiWorld(1)
    world.line.connect()
    columns = world.line.farm.columns
    tables = (columns.axis, columns.image, columns.ppm, columns.cpm, columns.engine, columns.impairment)
    before = [table.tobytes() for table in tables]
    assert world.get("/api/v1/drives").status_code == 200
    assert world.get("/metrics").status_code == 200
    assert [table.tobytes() for table in tables] == before
