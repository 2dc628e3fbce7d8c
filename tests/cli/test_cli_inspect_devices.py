"""`pnfarm inspect` with devices, against an API that answers what each test wants."""

import json

LISTED = {
    "name": "island",
    "description": "Island head",
    "mac": "02:00:00:00:00:29",
    "ip": "10.77.0.41/24",
    "powered": True,
    "connected": True,
}
SAFE = {"subslot": 1, "ident": 97, "name": "4FDI", "input_octets": 5, "output_octets": 4, "safety": True}
WHOLE = {
    **LISTED,
    "station_name": "island",
    "identity": {"order_number": "EX-ISL-100"},
    "access_point": "DAP 1",
    "modules": [{"slot": 4, "ident": 96, "name": "4FDI", "submodules": [SAFE]}],
    "connection": {"state": "DATA", "controller": {"name": "plc"}, "cycle_seconds": 0.016},
    "signals": [{"name": "part_present"}],
}


def words(text):
    return [" ".join(line.split()) for line in text.splitlines()]


def test_devices_are_listed_behind_the_drives(ask, farm):
    farm.answer("GET", "drives", {"farm": "line-1", "drives": [], "lines": []})
    off = {**LISTED, "name": "gate", "ip": None, "powered": False, "connected": False}
    farm.answer("GET", "devices", {"devices": [LISTED, off]})
    lines = words(ask("inspect").out)
    assert "island Island head connected 10.77.0.41/24 02:00:00:00:00:29" in lines
    assert "gate Island head off - 02:00:00:00:00:29" in lines


def test_one_device_is_shown_with_its_modules_and_what_it_does_not_do(ask, farm):
    farm.answer("GET", "devices", {"devices": [LISTED]})
    farm.answer("GET", "devices/island", WHOLE)
    lines = words(ask("inspect", "island").out)
    assert "order number EX-ISL-100" in lines
    assert "controller plc" in lines
    assert (
        "4.1 4FDI 4FDI 5 4 safe: the device does not run the safety protocol, so that its controller passivates it"
        in lines
    )
    assert lines[-1] == "1 signal: `pnfarm io island`"
    assert json.loads(ask("inspect", "island", "--format", "json").out) == WHOLE


def test_a_device_is_shown_with_each_frame_of_its_connection(ask, farm):
    place = {"offset": 0, "what": "data", "of": "slot 1, subslot 0x0001", "octets": 8}
    frame = {"direction": "sent", "octets": 40, "timeout_seconds": None, "places": [place]}
    channels = [{**frame, "id": "0x8000", "cycle_seconds": 0.008}, {**frame, "id": "0x8001", "cycle_seconds": 0.064}]
    agreed = {"controller": "plc", "start_up": "legacy", "channels": channels}
    farm.answer("GET", "devices", {"devices": [LISTED]})
    farm.answer("GET", "devices/island", {**WHOLE, "details": {"connections": [agreed]}})
    lines = words(ask("inspect", "island").out)
    assert "agreed: controller plc, start up legacy" in lines
    assert "sent by the device 0x8000 40 8 ms 0 data slot 1, subslot 0x0001" in lines
    assert "sent by the device 0x8001 40 64 ms 0 data slot 1, subslot 0x0001" in lines


def test_a_name_that_no_drive_and_no_device_has_is_refused(ask, farm):
    farm.answer("GET", "devices", {"devices": [LISTED]})
    outcome = ask("inspect", "ghost")
    assert (outcome.code, "there is no" in outcome.err) == (2, True)


def test_readiness_names_controllers_refusals_and_the_line_to_change(ask, farm):
    refusal = {"text": "slot 3: the slot is empty", "place": "3", "works": False, "count": 4, "file": "cell.pnfarm.yml",
               "line": 14, "key": "devices[0].slots.3"}  # fmt: skip
    visit = {"controller": 0, "state": "data", "steps": {"searched": 1.0, "data": 2.0}, "cycle_seconds": 0.016,
             "refusals": [refusal]}  # fmt: skip
    place = {"file": "cell.pnfarm.yml", "line": 4, "key": "devices[0].name"}
    view = {
        "ready": False,
        "controllers": [{"bus": "profinet", "address": "10.0.0.1", "mac": "", "name": "plc", "exchanging": 1,
                         "stations": 1}],
        "stations": [{"name": "island", "state": "partly", "visits": [visit], **place},
                     {"name": "gate", "state": "unseen", "visits": [], **place, "line": 9}],
        "missing": [{"name": "pump-3", "controller": 0, "text": "none is called pump-3; pump-2 is near", **place}],
    }  # fmt: skip
    farm.answer("GET", "readiness", view)
    lines = words(ask("inspect", "--readiness").out)
    assert "plc 10.0.0.1 on profinet: 1 of 1 station exchange data" in lines
    assert "island data searched, data 16 ms" in lines
    assert "gate not asked for cell.pnfarm.yml:9 devices[0].name" in lines
    assert "island refused slot 3: the slot is empty; change cell.pnfarm.yml:14 devices[0].slots.3" in lines
    near = "pump-3 plc 10.0.0.1 none is called pump-3; pump-2 is near"
    assert f"{near}; change cell.pnfarm.yml:4 devices[0].name" in lines
    found = ask("inspect", "island", "--readiness")
    assert (found.code, "--readiness is about all stations" in found.err) == (2, True)


def test_readiness_says_why_a_connection_ended_and_shows_no_table_without_rows(ask, farm):
    visit = {"controller": 0, "state": "ended", "steps": {"searched": 1.0}, "cycle_seconds": None, "refusals": [],
             "ended": "watchdog expired"}  # fmt: skip
    view = {
        "ready": False,
        "controllers": [{"bus": "profinet", "address": "10.0.0.1", "mac": "", "name": "plc", "exchanging": 0,
                         "stations": 1}],
        "stations": [{"name": "press", "state": "ended", "visits": [visit], "file": "", "line": 0, "key": ""}],
        "missing": [],
    }  # fmt: skip
    farm.answer("GET", "readiness", view)
    lines = words(ask("inspect", "--readiness").out)
    assert "press not connected searched" in lines
    assert "press not connected the connection ended: watchdog expired" in lines
    assert not [line for line in lines if line.startswith(("NO CONTROLLER", "ASKED FOR"))]


def test_a_long_value_is_cut_in_the_table_of_all_signals_and_whole_where_it_is_asked_for(ask, farm):
    octets = " ".join(["0f"] * 64)
    signal = {"name": "image", "direction": "input", "type": "octets[64]", "value": octets, "shown": octets, "unit": "",
              "good": True, "owner": "default", "forced": None, "place": "1.1.0"}  # fmt: skip
    farm.answer("GET", "devices", {"devices": [{"name": "camera"}]})
    farm.answer("GET", "plant", {"models": []})
    farm.answer("GET", "devices/camera/signals", {"device": "camera", "signals": [signal]})
    (row,) = (line for line in ask("io").out.splitlines() if "image" in line)
    assert "0f 0f 0f... " in row
    assert len(row) < 120
    assert ask("io", "camera.image").out == f"camera.image = {octets}\n"
