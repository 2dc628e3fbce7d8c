"""The modules in a drive's slots, pulled and plugged over HTTP while a controller watches."""

from __future__ import annotations

import pytest
from api_world import ApiWorld, assert_problem

from pnfarm.buses.profinet.api.schemas import ModulesView, PluggedView

PATH = "/api/v1/drives/axis-01/modules"


@pytest.fixture
def world() -> ApiWorld:
    made = ApiWorld(1)
    made.line.connect()
    made.line.enable()
    return made


def modules(response):
    assert response.status_code == 200, response.text
    view = PluggedView if response.request.method == "PUT" else ModulesView
    return view.model_validate_json(response.content).modules


def frame_status(world):
    """IOPS of the drive's telegram as its next frame carries it, and whether set points are valid."""
    world.line.run(0.1)
    farm = world.line.farm
    (ar,) = farm.axis("axis-01").device.ars.values()
    ((row, cr),) = ar.providers
    place = cr.data_of(1, 2)
    return farm.channels.provided(row)[place.iops_offset], bool(farm.columns.image[0].valid)


def test_the_slots_show_their_modules_and_who_owns_them(world):
    dap, drive = modules(world.get(PATH))
    assert (dap.slot, drive.slot, drive.telegram, drive.held) == (0, 1, 1, False)
    assert {s.owner for s in (*dap.submodules, *drive.submodules)} == {"plc"}


def test_a_pulled_module_makes_its_data_bad_and_a_plugged_one_waits_for_its_parameters(world):
    assert frame_status(world) == (0x80, True)
    (_, drive) = modules(world.delete(f"{PATH}/1"))
    assert (drive.module_ident, drive.submodules, drive.held) == (None, [], True)
    assert frame_status(world) == (0x40, False)
    assert world.get("/api/v1/drives/axis-01").json()["ar_state"] == "DATA"
    (_, drive) = modules(world.put(f"{PATH}/1", {}))
    assert (drive.telegram, drive.held) == (1, False)
    assert "module pulled" in world.line.events("axis-01")
    assert "module plugged" in world.line.events("axis-01")


def test_one_submodule_is_pulled_by_its_subslot(world):
    (_, drive) = modules(world.delete(f"{PATH}/1?subslot=2"))
    assert [s.subslot for s in drive.submodules] == ["0x0001"]


def test_a_wrong_module_is_listed_with_its_ident(world):
    (_, drive) = modules(world.put(f"{PATH}/1", {"module_ident": 0x1234}))
    assert (drive.module_ident, drive.telegram, drive.held) == ("0x00001234", None, True)
    assert frame_status(world) == (0x40, False)


def test_the_module_of_another_telegram_is_plugged_by_its_number(world):
    (_, drive) = modules(world.put(f"{PATH}/1", {"telegram": 9}))
    assert drive.telegram == 9


def test_plugging_what_is_there_already_changes_nothing_and_says_so(world):
    events = world.line.events("axis-01")
    for body in ({}, {"telegram": 1}):
        answer = world.put(f"{PATH}/1", body)
        assert answer.json()["changed"] is False
        assert modules(answer)[1].telegram == 1
    assert frame_status(world) == (0x80, True)
    assert world.line.events("axis-01") == events
    assert [world.put(f"{PATH}/1", {"telegram": 9}).json()["changed"] for _ in range(2)] == [True, False]


def test_what_follows_the_controller_is_not_replaced_by_plugging_what_was_never_pulled(world):
    station = world.line.farm.axis("axis-01")
    station.device.cm.plugged.follow(1, station.model.profidrive.telegrams[9].module.ident)
    answer = world.put(f"{PATH}/1", {})
    assert (answer.json()["changed"], modules(answer)[1].telegram) == (False, 9)


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "words"),
    [
        ("DELETE", "/0", None, 422, ("access point", "allowed: 1")),
        ("DELETE", "/7", None, 422, ("slot 7", "allowed: 1")),
        ("DELETE", "/1?subslot=9", None, 422, ("0x0009", "0x0001")),
        ("PUT", "/1", {"telegram": 4711}, 422, ("4711", "it has")),
        ("PUT", "/1", {"module_ident": 0}, 422, ("module_ident",)),
        ("PUT", "/1", {"telegram": 1, "module_ident": 5}, 422, ("either",)),
        ("PUT", "/1", {"substitute": True}, 422, ("substitute",)),
        ("PUT", "/1", {"colour": "red"}, 422, ("colour", "allowed: telegram")),
    ],
)
def test_what_cannot_be_pulled_or_plugged_is_reported_in_a_sentence(world, method, path, body, status, words):
    response = world.request(method, PATH + path, **({} if body is None else {"json": body}))
    assert_problem(response, status, *words)


def test_an_empty_slot_cannot_be_pulled_and_a_drive_without_supply_has_no_hands(world):
    world.delete(f"{PATH}/1")
    assert_problem(world.delete(f"{PATH}/1"), 422, "already empty")
    world.line.farm.axis("axis-01").station.power_off(world.line.world.now)
    assert_problem(world.put(f"{PATH}/1", {}), 422, "switched off")


class Stranger:
    """A device on a bus without modules."""


@pytest.mark.parametrize(("method", "path"), [("GET", ""), ("PUT", "/1"), ("DELETE", "/1")])
def test_a_drive_on_another_bus_has_no_modules(world, monkeypatch, method, path):
    station = world.line.farm.station("axis-01")
    monkeypatch.setattr(station, "bus", "other")
    monkeypatch.setattr(station, "device", Stranger())
    response = world.request(method, PATH + path, **({"json": {}} if method == "PUT" else {}))
    assert_problem(response, 404, "axis-01 has no modules: it is a drive on other")
