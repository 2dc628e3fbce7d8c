"""inspect, fault and param against an API that answers what each test wants."""

import json

import pytest
from fake_api import RECORD

from pnfarm.errors import ConfigError
from pnfarm.terminal.client import FarmClient

DRIVE = {
    "name": "axis-01",
    "state": "S4",
    "telegram": 1,
    "ar_state": "DATA",
    "controller": {"name": "plc", "ip": "10.77.0.1", "mac": "02:00:00:00:00:01"},
    "cycle_seconds": 0.016,
    "velocity_rpm": 600.04,
    "fault": None,
    "last_fault": {"number": 702, "name": "Fieldbus communication lost"},
    "faults_injected": ["trip"],
    "powered": True,
    "stw1_bits": ["on", "[no]_markup"],
}
FAULT = {
    "id": "trip",
    "kind": "f702",
    "state": "active",
    "evidence": {"checks": 3, "activations": 1, "confirmed": True},
    "drives": {f"axis-{n:02}": {} for n in range(1, 12)},
}
PARAMETER = {
    "drive": "axis-01",
    "pnu": 2135,
    "subindex": 0,
    "name": "DRV.OPMODE",
    "value": 1,
    "values": None,
    "unit": "",
}
ENTRY = {"sequence": 7, "time": 1.7e9, "farm_seconds": 1.0, "drive": "axis-01", "event": "fault", "number": 702}


# -- inspect


def test_inspect_shows_each_drive_in_a_line(ask, farm):
    farm.answer("GET", "drives", {"farm": "line-1", "drives": [DRIVE]})
    head, line = ask("inspect").out.splitlines()
    assert head.split()[:3] == ["DRIVE", "STATE", "TELEGRAM"]
    wanted = "axis-01 S4 1 DATA plc 10.77.0.1 16 ms 600.0 F702 Fieldbus communication lost trip"
    assert " ".join(line.split()) == wanted


def test_inspect_as_json_is_the_apis_answer(ask, farm):
    farm.answer("GET", "drives", {"farm": "line-1", "drives": [DRIVE]})
    assert json.loads(ask("inspect", "--format", "json").out)["drives"] == [DRIVE]


def test_inspect_of_one_drive_shows_every_field(ask, farm):
    farm.inspected(DRIVE)
    text = ask("inspect", "axis-01").out
    for line in ("powered          yes", "cycle seconds    16 ms", "stw1 bits        on, [no]_markup"):
        assert line in text
    assert json.loads(ask("inspect", "axis-01", "--format", "json").out) == {**DRIVE, "controller_record": RECORD}


def test_inspect_of_one_drive_shows_what_its_controller_did(ask, farm):
    farm.inspected(DRIVE)
    text = ask("inspect", "axis-01").out
    for line in (
        "mean interval           16 ms",
        "mean jitter             -",
        "missed updates          1,200",
        "late frames             controller 1, farm 2",
        "watchdog expirations    controller 0, farm 3",
        "connects                2 of 7 attempts, 4 refused",
        "last start-up           identify 1 s, connect 500 ms",
        "of                      plc, 5 attempts",
        "reconnected after       1.5 s",
        "last fault              F702, injected: timeout",
        "enable withdrawn after  32 ms",
        "STW1 after it           on=0 32 ms",
        "acknowledged after      -",
    ):
        assert line in text.splitlines()


def test_inspect_of_one_drive_says_who_its_neighbour_is(ask, farm):
    neighbour = {
        "port": "port-001",
        "station": "switch-1",
        "chassis": "switch-1",
        "port_id": "port-003",
        "system_name": None,
        "mac": "02:00:00:00:00:99",
        "ip": None,
        "seen_seconds_ago": 1.5,
    }
    farm.inspected(DRIVE | {"neighbours": [neighbour]})
    text = " ".join(ask("inspect", "axis-01").out.split())
    assert "neighbours switch-1 port-003 (02:00:00:00:00:99) at port-001" in text


def test_inspect_of_one_drive_says_what_was_agreed_and_what_is_where_in_a_frame(ask, farm):
    places = [
        {"of": "slot 1, subslot 0x0002", "what": "data", "offset": 4, "octets": 4},
        {"of": "slot 1, subslot 0x0002", "what": "provider status", "offset": 8, "octets": 1},
    ]
    channel = {"direction": "sent", "id": "0x8001", "octets": 40, "cycle_seconds": 0.016, "places": places}
    agreed = {"controller": "plc", "session_key": 2, "channels": [channel]}
    farm.inspected(DRIVE | {"details": {"connections": [agreed]}})
    text = " ".join(ask("inspect", "axis-01").out.split())
    assert "agreed: controller plc, session key 2" in text
    row = "sent by the drive 0x8001 40 16 ms 4 data slot 1, subslot 0x0002; 8 provider status slot 1, subslot 0x0002"
    assert row in text


def test_a_name_with_odd_letters_stays_one_name(ask, farm):
    farm.inspected({**DRIVE, "name": "a/b c"}, "drives/a%2Fb%20c")
    assert ask("inspect", "a/b c").code == 0


@pytest.mark.parametrize("name", ["", ".", ".."])
@pytest.mark.parametrize(
    "words", ["inspect {}", "fault list {}", "fault clear {}", "state delete {}", "param get {} 1"]
)
def test_a_name_that_would_be_another_path_of_the_api_is_refused(ask, farm, words, name):
    for path in ("", "drives", "drives/", "faults", "faults/", "states", "states/", "drives/params/1", "params/1"):
        for method in ("GET", "DELETE"):
            farm.answer(method, path, {"farm": "line-1", "drives": [DRIVE], "faults": [FAULT]})
    found = ask(*(name if word == "{}" else word for word in words.split()))
    assert found.code == 2
    assert f"{name!r} is no name" in found.err


def test_events_are_lines_or_json_lines(ask, farm):
    farm.answer("GET", "drives/axis-01", DRIVE)
    stream = (
        f"retry: 2000\n\n: alive\n\nid: 7\ndata: {json.dumps(ENTRY)}\n\nevent: gap\ndata: {json.dumps({'lost': 3})}\n\n"
    )
    farm.answer("GET", "events", stream)
    farm.answer("GET", "events?drive=axis-01", stream)
    first, second = ask("inspect", "--events").out.splitlines()
    assert first.endswith("axis-01          fault  number=702")
    assert "3 older events" in second
    lines = ask("inspect", "axis-01", "--events", "--format", "json").out.splitlines()
    assert [json.loads(line) for line in lines] == [ENTRY, {"lost": 3}]


def test_discards_and_the_last_events_of_a_drive_stand_below_its_fields(ask, farm):
    discards = {"arp-for-another": 1200, "old-counter": 3}
    events = [{**ENTRY, "sequence": n, "event": "watchdog expired", "silent_seconds": 0.048} for n in range(12)]
    farm.inspected({**DRIVE, "frames_discarded": discards, "events": events})
    lines = ask("inspect", "axis-01").out.splitlines()
    assert "frames discarded  1,203" in lines
    head = next(n for n, line in enumerate(lines) if line.startswith("DISCARDED"))
    assert lines[head].split() == ["DISCARDED", "REASON", "WHAT", "IT", "MEANS"]
    assert lines[head + 1].split(maxsplit=2) == ["1,200", "arp-for-another", "ARP request for another address"]
    assert lines[head + 2].split(maxsplit=2)[2].startswith("cyclic frame whose cycle counter does not advance")
    assert lines[-1].endswith("axis-01          watchdog expired  number=702  silent=48 ms")
    assert sum("watchdog expired" in line for line in lines) == 8


def test_the_events_that_are_kept_of_a_drive_are_shown_without_waiting(ask, farm):
    farm.answer("GET", "drives/axis-01", {**DRIVE, "events": [ENTRY]})
    (line,) = ask("inspect", "axis-01", "--events", "--no-follow").out.splitlines()
    assert line.endswith("axis-01          fault  number=702")
    assert json.loads(ask("inspect", "axis-01", "--events", "--no-follow", "--format", "json").out) == ENTRY


def test_the_events_that_are_kept_of_a_farm_are_shown_without_waiting(ask, farm):
    farm.answer("GET", "events?follow=false", f"retry: 2000\n\nid: 7\ndata: {json.dumps(ENTRY)}\n\n")
    found = ask("inspect", "--events", "--no-follow")
    assert found.code == 0
    (line,) = found.out.splitlines()
    assert line.endswith("axis-01          fault  number=702")


@pytest.mark.parametrize("names", [(), ("axis-01",)])
def test_nothing_is_followed_where_no_events_are_asked_for(ask, names):
    found = ask("inspect", *names, "--no-follow")
    assert found.code == 2
    assert "needs --events" in found.err


# -- fault


def test_fault_add_sends_what_was_asked_for_and_prints_the_id(ask, farm):
    farm.answer("POST", "faults", FAULT, 201)
    line = (
        "fault add f702 --on axis-* --on model:akd --param hold=true -p code=0x10 -p x=1.5 -p word=nan --for 5s "
        "--count 2 --cycles 3 --probability 0.5 --seed 7 --direction out --after-cycles 9 --after 1s --as trip"
    )
    found = ask(*line.split())
    assert found.out.startswith("trip: f702 active on axis-01 ")
    assert found.out.endswith("and 3 more\n")
    _, _, body, _ = farm.asked[-1]
    assert body == {
        "kind": "f702",
        "on": ["axis-*", "model:akd"],
        "params": {"hold": True, "code": 16, "x": 1.5, "word": "nan"},
        "for": "5s",
        "count": 2,
        "cycles": 3,
        "probability": 0.5,
        "seed": 7,
        "direction": "out",
        "after_cycles": 9,
        "after": "1s",
        "as": "trip",
    }


def test_what_is_not_given_is_not_sent(ask, farm):
    farm.answer("POST", "faults", FAULT, 201)
    assert json.loads(ask("fault", "add", "timeout", "--on", "all", "--format", "json").out) == FAULT
    assert farm.asked[-1][2] == {"kind": "timeout", "on": ["all"], "params": {}}


def test_reach_repetition_and_time_to_live_are_sent_as_given(ask, farm):
    farm.answer("POST", "faults", FAULT, 201)
    reach = ["--share", "25%", "--most", "3", "--rate", "2/min", "--times", "5", "--ttl", "10s"]
    ask("fault", "add", "loss", "--on", "all", *reach, "--for", "1s")
    wanted = {"share": "25%", "most": 3, "rate": "2/min", "times": 5, "ttl": "10s", "for": "1s"}
    assert farm.asked[-1][2] == {"kind": "loss", "on": ["all"], "params": {}} | wanted


def test_parameters_of_a_kind_may_be_options(ask, farm):
    farm.answer("POST", "faults", FAULT, 201)
    ask(
        "fault",
        "add",
        "diagnosis",
        "--on",
        "all",
        "--error",
        "wire break",
        "--slot=3",
        "-p",
        "channel=2",
        "--for",
        "1s",
    )
    params = {"error": "wire break", "slot": 3, "channel": 2}
    assert farm.asked[-1][2] == {"kind": "diagnosis", "on": ["all"], "params": params, "for": "1s"}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ["--erro", "wire break"],
            "no such option: --erro, did you mean error?; the parameters of diagnosis are error, ",
        ),
        (["--probabilty", "0.5"], "no such option: --probabilty, did you mean probability?"),
        (["--slot"], "--slot needs a value"),
        (["3"], "'3' is not an option; see `pnfarm fault add --help`"),
    ],
)
def test_a_wrong_option_of_a_fault_is_refused_before_the_farm_is_asked(ask, farm, words, sentence):
    done = ask("fault", "add", "diagnosis", "--on", "all", *words)
    assert (done.code, sentence in done.err, farm.asked) == (2, True, [])


def test_values_of_a_fault_come_from_a_file_beside_the_user(ask, farm, tmp_path):
    farm.answer("POST", "faults", FAULT, 201)
    (tmp_path / "trace.csv").write_text("time [s],axis-01 velocity [rpm],pressure\n-0.5,10,1.5\n0,11,2\n")
    values = f"values=@{tmp_path}/trace.csv#pressure"
    assert ask("fault", "add", "signal-replay", "--on", "island-1", "-p", "signal=pressure", "-p", values).code == 0
    assert farm.asked[-1][2]["params"] == {"signal": "pressure", "values": "0:1.5 0.5:2"}
    found = ask("fault", "add", "signal-replay", "--on", "island-1", "-p", "signal=pressure", "-p", f"{values}s")
    assert found.code == 2
    assert "trace.csv, line 1: there is no column 'pressures', did you mean pressure?" in found.err


def test_a_dry_run_shows_whom_the_fault_would_hit_and_why_others_cannot(ask, farm):
    reach = {
        "dry_run": True,
        "kind": "slow-ramp",
        "spec": {"kind": "slow-ramp", "on": ["all"], "seed": 7},
        "drives": ["axis-01"],
        "cannot": [{"drive": "axis-02", "why": "axis-02 has no ramp generator"}],
        "left_out": ["axis-03"],
    }
    farm.answer("POST", "faults?dry_run=true", reach)
    head, *lines, end = ask("fault", "add", "slow-ramp", "--on", "all", "--dry-run").out.splitlines()
    assert head.split() == ["DRIVE", "HIT", "WHY", "NOT"]
    assert [" ".join(line.split()) for line in lines] == [
        "axis-01 yes",
        "axis-02 no axis-02 has no ramp generator",
        "axis-03 no left out by share or most",
    ]
    assert end.startswith("slow-ramp would hit 1 of 3 drives, and is refused")
    assert end.endswith("--seed 7 chooses the same")
    assert json.loads(ask("fault", "add", "slow-ramp", "--on", "all", "--dry-run", "--format", "json").out) == reach
    found = ask("fault", "add", "slow-ramp", "--on", "all", "--dry-run", "--hold")
    assert (found.code, "--hold" in found.err) == (2, True)


def test_hold_renews_the_fault_until_it_ends(ask, farm):
    held = FAULT | {"spec": {"kind": "f702", "on": ["all"], "ttl": "100ms"}}
    farm.answer("POST", "faults", held, 201)
    farm.answer("GET", "faults/trip", held)
    farm.answer("POST", "faults/trip/renew", held | {"state": "ended"})
    assert ask("fault", "add", "f702", "--on", "all", "--hold").out.splitlines()[-1] == "trip: ended"
    assert farm.asked[0][2]["ttl"] == "5s"
    assert [(method, path) for method, path, *_ in farm.asked[1:]] == [
        ("GET", "/api/v1/faults/trip"),
        ("POST", "/api/v1/faults/trip/renew"),
    ]


def test_a_hold_whose_fault_lapsed_says_so(ask, farm):
    held = FAULT | {"spec": {"kind": "f702", "on": ["all"], "ttl": "100ms"}}
    farm.answer("POST", "faults", held, 201)
    farm.answer("GET", "faults/trip", held | {"state": "ended"})
    assert ask("fault", "add", "f702", "--on", "all", "--hold", "--ttl", "100ms").out.splitlines()[-1] == "trip: ended"


def test_a_hold_as_json_is_the_fault_as_it_began_and_as_it_ended(ask, farm):
    held = FAULT | {"spec": {"kind": "f702", "on": ["all"], "ttl": "100ms"}}
    farm.answer("POST", "faults", held, 201)
    farm.answer("GET", "faults/trip", held | {"state": "ended"})
    text = ask("fault", "add", "f702", "--on", "all", "--hold", "--format", "json").out
    began, end = json.JSONDecoder().raw_decode(text)
    assert (began["state"], json.loads(text[end:])["state"]) == ("active", "ended")


@pytest.mark.parametrize("number", ["nan", "inf", "-1", "1.5"])
def test_a_probability_that_is_none_is_bad_input_and_nothing_is_asked(ask, farm, number):
    found = ask("fault", "add", "loss", "--on", "all", "--probability", number)
    assert (found.code, farm.asked) == (2, [])
    assert "--probability" in found.err


@pytest.mark.parametrize("word", ["hold", "=1"])
def test_a_parameter_without_name_or_value_is_bad_input(ask, word):
    found = ask("fault", "add", "f702", "--on", "all", "--param", word)
    assert found.code == 2
    assert "NAME=VALUE" in found.err


def test_fault_list_shows_the_evidence(ask, farm):
    farm.answer("GET", "faults", {"faults": [FAULT]})
    _, line = ask("fault", "list").out.splitlines()
    assert line.split()[:6] == ["trip", "f702", "active", "3", "1", "yes"]


def test_a_list_of_no_faults_says_so(ask, farm):
    farm.answer("GET", "faults", {"faults": []})
    assert ask("fault", "list").out == "no fault is pending or active\n"
    assert json.loads(ask("fault", "list", "--format", "json").out) == {"faults": []}


def test_fault_list_of_one_shows_the_evidence_of_a_fault_that_ended(ask, farm):
    farm.answer("GET", "faults/trip", {**FAULT, "state": "ended"})
    _, line = ask("fault", "list", "trip").out.splitlines()
    assert line.split()[:6] == ["trip", "f702", "ended", "3", "1", "yes"]
    assert json.loads(ask("fault", "list", "trip", "--format", "json").out)["faults"][0]["state"] == "ended"


def test_fault_clear_ends_one_or_all(ask, farm):
    farm.answer("DELETE", "faults/trip", FAULT)
    farm.answer("POST", "reset", {"cleared": ["a", "b"]})
    assert ask("fault", "clear", "trip").out == "cleared trip\n"
    assert ask("fault", "clear").out == "cleared a b\n"
    whole = [{"id": "a", "kind": "loss", "drives": ["axis-01", "axis-02"]}]
    farm.answer("POST", "reset", {"cleared": ["a"], "faults": whole})
    assert ask("fault", "clear").out == "cleared a\n  a: loss on axis-01 axis-02\n"
    farm.answer("POST", "reset", {"cleared": []})
    assert ask("fault", "clear").out == "no fault was active\n"
    farm.answer("DELETE", "faults/all", {"detail": "there is no fault 'all'; none is in force"}, 404)
    assert "`pnfarm fault clear` without a name clears all" in ask("fault", "clear", "all").err


# -- param


def test_param_get_prints_the_value_with_its_name(ask, farm):
    farm.answer("GET", "drives/axis-01/params/DRV.OPMODE", PARAMETER)
    assert ask("param", "get", "axis-01", "DRV.OPMODE").out == "axis-01 2135.0 DRV.OPMODE = 1\n"
    assert json.loads(ask("param", "get", "axis-01", "DRV.OPMODE", "--format", "json").out) == PARAMETER


def test_param_get_prints_every_element_of_an_array(ask, farm):
    farm.answer("GET", "drives/axis-01/params/964", PARAMETER | {"values": [261, 1, 117], "unit": "x"})
    assert ask("param", "get", "axis-01", "964").out.endswith("= 261 1 117 x\n")
    speed = {"value": 480755, "unit": "rpm", "factor": 0.001}
    farm.answer("GET", "drives/axis-01/params/964", PARAMETER | speed)
    assert ask("param", "get", "axis-01", "964").out.endswith("= 480755 (480.755 rpm)\n")


@pytest.mark.parametrize(("text", "value"), [("2", 2), ("-5", -5), ("0x1F", 31), ("007", 7)])
def test_param_set_sends_a_number(ask, farm, text, value):
    farm.answer("PUT", "drives/axis-01/params/930", PARAMETER)
    assert ask("param", "set", "axis-01", "930", text).code == 0
    assert farm.asked[-1][2] == {"value": value}


def test_param_set_refuses_what_is_no_number(ask, farm):
    found = ask("param", "set", "axis-01", "930", "fast")
    assert found.code == 2
    assert "'fast' is not a parameter value" in found.err
    assert farm.asked == []


# -- errors


def test_the_farms_sentence_is_the_commands_sentence(ask, farm):
    farm.answer("GET", "drives/axis-09", {"detail": "there is no drive 'axis-09'"}, 404)
    found = ask("inspect", "axis-09")
    assert (found.code, found.err) == (2, "pnfarm: there is no drive 'axis-09'\n")


@pytest.mark.parametrize(
    ("status", "body", "code", "told"),
    [
        (422, {"detail": "a: is b"}, 2, "a: is b"),
        (503, {"detail": "the engine stands"}, 4, "the engine stands"),
        (500, {"detail": "internal error: KeyError"}, 5, "internal error: KeyError"),
        (401, {"detail": "token?"}, 2, "PNFARM_TOKEN"),
        (404, "<html>nothing</html>", 4, "is not a farm"),
        (500, {"error": "x"}, 4, "is not a farm"),
        (200, "<html>hello</html>", 4, "is not a farm"),
    ],
)
def test_an_error_of_the_api_has_its_exit_code(ask, farm, status, body, code, told):
    farm.answer("GET", "drives", body, status)
    found = ask("inspect")
    assert found.code == code
    assert told in found.err
    assert found.err.count("\n") == 1


def test_a_farm_that_is_not_there_is_told_with_the_way_to_start_one(pnfarm):
    found = pnfarm("inspect", "--api", "127.0.0.1:1")
    assert found.code == 4
    assert "no farm answers at 127.0.0.1:1" in found.err
    assert "`pnfarm up FILE`, or give its address with --api" in found.err


def test_a_scenario_without_its_farm_names_the_option_that_the_command_has(pnfarm, tmp_path):
    file = tmp_path / "wait.scenario.yml"
    file.write_text("scenario: wait\nfarm: http://127.0.0.1:1\nsteps: [{wait: 1s}]\n")
    found = pnfarm("run", file)
    assert found.code == 4
    assert found.err.endswith(", or give its address with --farm\n")


@pytest.mark.parametrize("address", ["ftp://127.0.0.1", "http://127.0.0.1/other/place", "", "http://[::1", "xn--a"])
def test_an_address_that_is_none_is_bad_input(pnfarm, address):
    found = pnfarm("inspect", "--api", address)
    assert found.code == 2
    assert "is not the address of a farm" in found.err


def test_the_token_is_shown_to_the_farm(ask, farm, monkeypatch):
    farm.answer("GET", "faults", {"faults": []})
    ask("fault", "list", "--token", "secret-1")
    monkeypatch.setenv("PNFARM_TOKEN", "secret-2")
    ask("fault", "list")
    assert [shown for *_, shown in farm.asked] == ["Bearer secret-1", "Bearer secret-2"]


def test_the_token_of_a_file_is_shown_where_none_is_given(ask, farm, monkeypatch, tmp_path):
    farm.answer("GET", "faults", {"faults": []})
    kept = tmp_path / "token"
    kept.write_text("of-the-file\n")
    monkeypatch.setenv("PNFARM_TOKEN_FILE", str(kept))
    assert ask("fault", "list").code == 0
    assert ask("fault", "list", "--token", "of-the-line").code == 0
    assert [asked[3] for asked in farm.asked] == ["Bearer of-the-file", "Bearer of-the-line"]
    kept.unlink()
    found = ask("fault", "list")
    assert found.code == 2
    assert f"the token's file {kept} (PNFARM_TOKEN_FILE) cannot be read: no such file" in found.err


def test_blanks_around_a_token_are_not_part_of_it(ask, farm, monkeypatch):
    farm.answer("GET", "faults", {"faults": []})
    monkeypatch.setenv("PNFARM_TOKEN", "secret-1\n")
    assert ask("fault", "list").code == 0
    assert [shown for *_, shown in farm.asked] == ["Bearer secret-1"]


@pytest.mark.parametrize("token", ["geheimes Wort", "Schlüssel", "two\nlines"])
def test_a_token_that_no_header_can_carry_is_refused_and_not_printed(ask, pnfarm, farm, token, monkeypatch):
    monkeypatch.setattr("anyio.run", lambda *_, **__: None)
    for found in (
        ask("fault", "list", "--token", token),
        pnfarm("hub", "--shard", farm.url, "--shard-token", token),
    ):
        assert (found.code, token.split()[0] in found.err, farm.asked) == (2, False, [])
        assert "the token has characters that no header can carry" in found.err


@pytest.mark.parametrize("arguments", [("inspect", "\udcff"), ("fault", "add", "loss", "--on", "axis-\udcff")])
def test_octets_that_are_no_text_are_bad_input(ask, farm, arguments):
    farm.answer("GET", "devices", {"devices": []})
    found = ask(*arguments)
    assert found.code == 2
    assert "has octets that are not text in UTF-8" in found.err


@pytest.mark.parametrize(("station", "words"), [("a" * 70_000, "url .*too long"), ("\udcff", "not text in UTF-8")])
def test_what_no_url_can_carry_is_bad_input_in_every_question(farm, station, words):
    with FarmClient(farm.url) as client:
        for ask in (lambda: client.get("drives", station), lambda: list(client.entries(station, follow=False))):
            with pytest.raises(ConfigError, match=words):
                ask()


def test_a_proxy_of_the_environment_does_not_stand_before_the_farm(ask, farm, monkeypatch):
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:1")
    farm.answer("GET", "faults", {"faults": []})
    assert ask("fault", "list").code == 0


@pytest.mark.parametrize("suffix", ["", "/", "/api/v1", "/api/v1/"])
def test_the_address_may_be_with_or_without_the_apis_path(pnfarm, farm, suffix):
    farm.answer("GET", "faults", {"faults": []})
    assert pnfarm("fault", "list", "--api", farm.url + suffix).code == 0
    assert pnfarm("fault", "list", "--api", farm.url.removeprefix("http://")).code == 0


def test_a_token_that_the_farm_does_not_know_is_not_called_missing(ask, farm):
    farm.answer("GET", "drives", {"detail": "token?"}, 401)
    assert "the farm needs its token" in ask("inspect").err
    assert "the farm does not know this token" in ask("inspect", "--token", "wrong").err
