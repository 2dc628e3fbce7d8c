"""pnio-dcp and profi-dcp (PyPI): every verb that they have, against three drives."""

import importlib.util
import json
import time

import pytest
from interop_rig import running

DRIVES = ["{name: 'axis-{n:02}', count: 3, model: akd-profinet, ip: 10.77.0.11/22, limits: lax}"]
LIBRARIES = ("pnio_dcp", "profi_dcp")
CONTROLLER = """
controller:
  name: plc
  ip: 10.77.3.250/22
  mac: 02:00:00:00:fa:01
  link: {kind: macvlan, parent: plc0}
  cycle: 16ms
  watchdog_factor: 100
  program: {kind: idle}
"""
NO_ERROR = "no error"
COMMUNICATION, ALL = [0, 4], [0, 8]


@pytest.fixture(params=LIBRARIES)
def client(request, lab):
    """Runs verbs in one session: a drive listens to one client at a time, and to that one for three seconds."""
    if importlib.util.find_spec(request.param) is None:
        pytest.skip(f"needs the package {request.param.replace('_', '-')}")
    return lambda *verbs: lab.peer_json("peer_dcp.py", request.param, json.dumps(verbs))


@pytest.fixture
def drives(lab, tmp_path):
    """A farm fresh from the factory for each test."""
    with running(lab, tmp_path, DRIVES) as worker:
        yield worker


def test_identify_finds_all_drives_and_each_one(client, drives):
    known = drives.ask("drives")
    everyone, *each = client(["identify_all", 2], *(["identify", drive["mac"]] for drive in known))
    expected = [
        {"name": d["name"], "mac": d["mac"], "ip": d["ip"].split("/")[0], "mask": "255.255.252.0", "family": "AKD"}
        for d in known
    ]
    assert everyone == sorted(expected, key=lambda d: d["mac"])
    assert each == expected


def test_get_reads_name_and_address_of_each_drive(client, drives):
    known = drives.ask("drives")
    verbs = [[verb, drive["mac"]] for drive in known for verb in ("get_name_of_station", "get_ip_address")]
    assert client(*verbs) == [text for drive in known for text in (drive["name"], drive["ip"].split("/")[0])]


def test_set_name_and_address_take_effect_at_once_and_last_when_permanent(client, drives):
    first, second, _ = (drive["mac"] for drive in drives.ask("drives"))
    results = client(
        ["set_name_of_station", first, "feeder-1", True],
        ["set_ip_address", first, ["10.77.1.1", "255.255.252.0", "10.77.0.1"], True],
        ["set_name_of_station", second, "for-now", False],
        ["set_ip_address", second, ["10.77.1.2", "255.255.252.0", "0.0.0.0"], False],
        ["get_name_of_station", first],
        ["get_ip_address", first],
        ["get_name_of_station", second],
        ["get_ip_address", second],
    )
    assert [result["ok"] for result in results[:4]] == [True] * 4, results
    assert results[4:] == ["feeder-1", "10.77.1.1", "for-now", "10.77.1.2"]
    for name in ("axis-01", "axis-02"):
        drives.ask("power", name=name, on=False)
        drives.ask("power", name=name, on=True)
    kept, forgotten = (drives.ask("drive", name=name) for name in ("axis-01", "axis-02"))
    assert (kept["name"], kept["ip"]) == ("feeder-1", "10.77.1.1/22")
    # a value set for now deletes the lasting one (IEC 61158-6-10: BlockQualifier "save the value temporary")
    assert (forgotten["name"], forgotten["ip"]) == ("", "")


def test_a_wrong_name_is_refused_and_changes_nothing(client, drives):
    mac = drives.ask("drive", name="axis-01")["mac"]
    (result,) = client(["set_name_of_station", mac, "ends-with-"])
    assert not result["ok"]
    assert drives.ask("drive", name="axis-01")["name"] == "axis-01"


def test_blink_flashes_the_lamp_of_that_drive_alone(client, drives):
    (result,) = client(["blink", drives.ask("drive", name="axis-02")["mac"]])
    assert result["ok"], result
    assert [drive["signalled"] for drive in drives.ask("drives")] == [False, True, False]
    deadline = time.monotonic() + 6
    while drives.ask("drive", name="axis-02")["signalling"]:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    events = [entry["event"] for entry in drives.ask("events", name="axis-02")]
    assert [event for event in events if "signal" in event] == ["signal begins", "signal ends"]


def test_wrong_addresses_are_refused_in_the_clients_own_words(client, drives):
    mac = drives.ask("drive", name="axis-01")["mac"]
    wrong = [
        ["224.0.0.1", "255.255.252.0", "0.0.0.0"],
        ["127.0.0.1", "255.255.252.0", "0.0.0.0"],
        ["10.77.0.0", "255.255.252.0", "0.0.0.0"],
        ["10.77.0.99", "255.0.252.0", "0.0.0.0"],
        ["10.77.0.99", "255.255.252.0", "10.78.0.1"],
    ]
    results = client(*(["set_ip_address", mac, suite] for suite in wrong))
    assert results == [{"ok": False, "message": "Code 03: Suboption not set"}] * len(wrong)
    assert drives.ask("drive", name="axis-01")["ip"] == "10.77.0.11/22"


def test_wrong_names_are_refused_in_the_clients_own_words(client, drives):
    mac = drives.ask("drive", name="axis-01")["mac"]
    wrong = ["port-001", "port-001-12345.axis", "a--b", "a..b", "x" * 64, "xn--axis", "a.-b"]
    results = client(*(["set_name_of_station", mac, name] for name in wrong))
    assert results == [{"ok": False, "message": "Code 03: Suboption not set"}] * len(wrong)
    assert drives.ask("drive", name="axis-01")["name"] == "axis-01"


def test_a_connected_drive_keeps_its_address_and_lets_go_for_another_name(client, drives, lab, tmp_path):
    mac = drives.ask("drive", name="axis-01")["mac"]
    folder = tmp_path / "plc"
    folder.mkdir()
    with running(lab, folder, DRIVES, rest=CONTROLLER, kind="plc", where="peer") as plc:
        assert plc.ask("wait_connected", seconds=15)
        refused, taken = client(
            ["set_ip_address", mac, ["10.77.1.1", "255.255.252.0", "0.0.0.0"]], ["set_name_of_station", mac, "press-7"]
        )
    assert refused == {"ok": False, "message": "Code 06: In operation, SET not possible"}
    assert taken["ok"], taken
    drive = drives.ask("drive", name="axis-01")
    assert (drive["name"], drive["ip"]) == ("press-7", "10.77.0.11/22")
    assert list(drive["aborts"]) == ["station-name-changed"]


def test_an_address_that_another_drive_has_is_told_and_not_used(client, drives):
    first, second, _ = drives.ask("drives")
    (result,) = client(["set_ip_address", second["mac"], ["10.77.0.11", "255.255.252.0", "0.0.0.0"], True])
    assert result["ok"], result
    deadline = time.monotonic() + 3
    while drives.ask("drive", name="axis-02")["ip"]:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert drives.ask("drive", name="axis-01")["ip"] == first["ip"]
    # the client still reads the address that the drive shall have
    assert client(["get_ip_address", second["mac"]]) == ["10.77.0.11"]


def test_resets_that_a_drive_has_not_are_refused_in_the_clients_own_words(client, drives):
    mac = drives.ask("drive", name="axis-01")["mac"]
    engineering, restore, reserved = client(
        ["reset_to_factory", mac, [0, 6]], ["reset_to_factory", mac, [0, 0x12]], ["reset_to_factory", mac, [0, 10]]
    )
    unsupported = "Code 02: Suboption unsupported or no DataSet available"
    assert [result["message"] for result in (engineering, restore)] == [unsupported] * 2
    assert reserved["message"] == "Code 03: Suboption not set"
    assert drives.ask("drive", name="axis-01")["name"] == "axis-01"


def test_a_reset_of_the_device_is_answered_before_the_drive_restarts(client, drives):
    mac = drives.ask("drive", name="axis-01")["mac"]
    (result,) = client(["reset_to_factory", mac, [0, 0x10]])
    assert result["ok"], result
    events = [entry["event"] for entry in drives.ask("events", name="axis-01")]
    happened = [event for event in events if event in {"factory reset", "power off", "power on"}]
    assert happened == ["factory reset", "power off", "power on"]


def test_resets_clear_what_their_mode_says(client, drives):
    first, second, third = (drive["mac"] for drive in drives.ask("drives"))
    results = client(
        ["reset_to_factory", first, COMMUNICATION],
        ["factory_reset", second],
        ["reset_to_factory", third, [0, 2]],
        ["reset_to_factory", third, [0, 0]],
    )
    assert [result["ok"] for result in results] == [True, True, True, False], results
    assert [(drive["name"], drive["ip"]) for drive in drives.ask("drives")] == [
        ("", ""),
        ("", ""),
        ("axis-03", "10.77.0.13/22"),
    ]


def test_a_drive_hears_no_second_client_for_three_seconds(lab, drives):
    """IEC 61158-5-10: the client hold time, which keeps two engineering tools from mixing their settings."""
    drive = drives.ask("drive", name="axis-01")
    answered = lab.peer_json("peer_raw.py", "hold", drive["mac"])
    assert answered == {"first": True, "second": False, "first again": True, "second later": True}
    assert drives.ask("drive", name="axis-01")["discards"]["held-by-other-client"] == 1
