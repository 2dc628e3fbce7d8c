"""``pnfarm module`` against an API that answers what each test wants, and against a device on a wire."""

import json
from typing import get_args

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.commands.module import Place, _place
from pnfarm.buses.profinet.device.modules import pull_module

SUBMODULES = [
    {
        "subslot": "0x0001",
        "submodule_ident": "0x0000FFFF",
        "api": "0x3A00",
        "input_bytes": 0,
        "output_bytes": 0,
        "owner": "plc",
        "awaits_parameters": False,
    },
    {
        "subslot": "0x0002",
        "submodule_ident": "0x00000064",
        "api": "0x3A00",
        "input_bytes": 4,
        "output_bytes": 4,
        "owner": None,
        "awaits_parameters": True,
    },
]
MODULES = {
    "drive": "axis-01",
    "modules": [
        {
            "slot": 1,
            "module_ident": "0x00000100",
            "telegram": 1,
            "held": False,
            "substitute": False,
            "submodules": SUBMODULES,
        },
        {"slot": 2, "module_ident": None, "telegram": None, "held": True, "substitute": False, "submodules": []},
        {
            "slot": 3,
            "module_ident": "0x00000555",
            "telegram": None,
            "held": True,
            "substitute": True,
            "submodules": [],
        },
    ],
}


def test_module_list_shows_the_slots_with_their_submodules(ask, farm):
    farm.answer("GET", "drives/axis-01/modules", MODULES)
    head, *lines = [" ".join(line.split()) for line in ask("module", "list", "axis-01").out.splitlines()]
    assert head == "SLOT SUBSLOT IDENT OCTETS OWNER"
    assert lines == [
        "1 0x00000100 (telegram 1)",
        "0x0001 0x0000FFFF 0 in, 0 out plc",
        "0x0002 0x00000064 4 in, 4 out awaits parameters",
        "2 empty held",
        "3 0x00000555 substitute held",
    ]
    assert json.loads(ask("module", "list", "axis-01", "--format", "json").out) == MODULES


def on_the_wire(monkeypatch, refused=""):
    """`module list` at a device that tells of two slots, or refuses; what it was asked for."""
    from types import SimpleNamespace

    from pnfarm.buses.profinet.commands import device
    from pnfarm.errors import RemoteError
    from pnfarm.protocols.profinet.wire.records.identification import (
        ApiData,
        IdentificationApi,
        IdentificationData,
        IdentificationSlot,
    )

    slots = (IdentificationSlot(0, 0x10, ((1, 0x11),)), IdentificationSlot(1, 0x100, ((1, 0xFFFF), (2, 0x68))))
    apis = (IdentificationApi(0, slots[:1]), IdentificationApi(0x3A00, slots[1:]))
    answers = {0xF821: ApiData((0,)).emit(), 0xF000: IdentificationData(0x0013, apis).emit()}
    asked = []

    def access(interface, own_ip, task, more):
        def check():
            if refused:
                raise RemoteError(refused)

        info = SimpleNamespace(name="device-7", ip="10.0.0.7")
        place = task.place
        while place is not None:
            asked.append((interface, own_ip, str(task.target), place))
            data = None if refused else answers[place[3]]
            client = SimpleNamespace(data=data, check=check, station=SimpleNamespace(info=info))
            place = more(client)
        return client

    monkeypatch.setattr(device, "access_device", access)
    return asked


@pytest.mark.parametrize("who", [("device-7",), ("--ip", "10.0.0.7")])
def test_module_list_shows_the_slots_of_any_device_on_the_wire(ask, monkeypatch, who):
    asked = on_the_wire(monkeypatch)
    head, *lines = [" ".join(line.split()) for line in ask("module", "list", *who, "-i", "eth1").out.splitlines()]
    assert head == "SLOT SUBSLOT IDENT API"
    assert lines == [
        "0 0x00000010",
        "0x0001 0x00000011",
        "1 0x00000100",
        "0x0001 0x0000FFFF 0x3A00",
        "0x0002 0x00000068 0x3A00",
    ]
    assert [(interface, target, place[3]) for interface, _, target, place in asked] == [
        ("eth1", who[-1], 0xF821),
        ("eth1", who[-1], 0xF000),
    ]


def test_module_list_of_a_device_as_json_has_the_names_of_a_drives(ask, monkeypatch):
    on_the_wire(monkeypatch)
    found = json.loads(ask("module", "list", "device-7", "-i", "eth1", "--format", "json").out)
    assert (found["name"], found["ip"]) == ("device-7", "10.0.0.7")
    module = found["modules"][1]
    assert module == {
        "slot": 1,
        "module_ident": "0x00000100",
        "submodules": [
            {"subslot": "0x0001", "submodule_ident": "0x0000FFFF", "api": "0x3A00"},
            {"subslot": "0x0002", "submodule_ident": "0x00000068", "api": "0x3A00"},
        ],
    }
    assert set(module) <= set(MODULES["modules"][0])


def test_module_list_says_why_a_device_tells_nothing(ask, monkeypatch):
    on_the_wire(monkeypatch, "IODReadRes: application: invalid index")
    done = ask("module", "list", "device-7", "-i", "eth1")
    assert (done.out, done.err) == ("", "pnfarm: IODReadRes: application: invalid index\n")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "NAME: is needed: a drive's, or a device's with --interface"),
        (("--ip", "10.0.0.7"), "is for a device on the wire, with --interface"),
        (("axis-01", "--own-ip", "10.0.0.1/24"), "is for a device on the wire, with --interface"),
        (("-i", "eth1"), "give one of them"),
        (("a", "-i", "eth1", "--ip", "10.0.0.7"), "give one of them"),
        (("-i", "eth1", "--ip", "10.0.0"), "is not an IPv4 address"),
        (("a" * 241, "-i", "eth1"), "a station name has 1 to 240"),
        (("a", "-i", "nowhere0"), "there is no interface nowhere0"),
    ],
)
def test_module_list_says_what_is_wrong_with_who_is_asked(ask, arguments, sentence):
    done = ask("module", "list", *arguments)
    assert done.code == 2
    assert sentence in done.err.replace("invalid value for ", "")


@pytest.mark.parametrize(
    ("place", "path"),
    [
        ("1", "drives/axis-01/modules/1"),
        ("1.2", "drives/axis-01/modules/1?subslot=2"),
        ("0.0x8001", "drives/axis-01/modules/0?subslot=32769"),
        ("0x1.0", "drives/axis-01/modules/1?subslot=0"),
    ],
)
def test_module_pull_names_a_slot_or_one_submodule_of_it(ask, farm, place, path):
    farm.answer("DELETE", path, MODULES)
    found = ask("module", "pull", "axis-01", place)
    assert found.code == 0, found.err
    assert "empty" in found.out
    assert [(method, asked, body) for method, asked, body, _ in farm.asked] == [("DELETE", f"/api/v1/{path}", None)]


def test_every_place_in_the_help_of_module_pull_can_be_pulled():
    text = get_args(Place)[1].help
    for example in text.partition(": ")[2].rstrip(".").split(", "):
        station = VirtualLine(1).farm.axis("axis-01")
        pull_module(station.device, *_place(example), 0)


@pytest.mark.parametrize(
    ("options", "body"),
    [
        ("", {"substitute": False}),
        ("--telegram 9", {"telegram": 9, "substitute": False}),
        ("--telegram 0", {"telegram": 0, "substitute": False}),
        ("--module 0x12345678", {"module_ident": 0x12345678, "substitute": False}),
        ("--module 0xFFFFFFFF --substitute", {"module_ident": 0xFFFFFFFF, "substitute": True}),
    ],
)
def test_module_plug_sends_what_is_plugged(ask, farm, options, body):
    farm.answer("PUT", "drives/axis-01/modules/1", MODULES | {"changed": True})
    found = ask("module", "plug", "axis-01", "1", *options.split(), "--format", "json")
    assert json.loads(found.out) == MODULES | {"changed": True}
    assert found.err == ""
    assert farm.asked[-1][2] == body


@pytest.mark.parametrize("output", ["table", "json"])
def test_module_plug_says_that_the_module_is_there_already(ask, farm, output):
    farm.answer("PUT", "drives/axis-01/modules/1", MODULES | {"changed": False})
    found = ask("module", "plug", "axis-01", "1", "--format", output)
    assert found.code == 0
    assert found.err == "slot 1 of axis-01 holds this module already; nothing was plugged\n"
    assert "0x00000064" in found.out


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("module pull axis-01 one", "'one' is not a valid slot"),
        ("module pull axis-01 1.", "'' is not a valid subslot"),
        ("module pull axis-01 1.x", "'x' is not a valid subslot"),
        ("module pull axis-01 -- -1", "'-1' is not a valid slot"),
        ("module pull axis-01 1.0x10000", "'0x10000' is not a valid subslot"),
        ("module plug axis-01 one", "'one' is not a valid slot"),
        ("module pull axis-01 65536", "'65536' is not a valid slot; give a number such as 1 or 0x8000, at most 0xFFFF"),
        ("module plug axis-01 0x10000", "'0x10000' is not a valid slot"),
        ("module plug axis-01 1 --module 0x100000000", "'0x100000000' is not a valid module ident"),
        ("module plug axis-01 1 --module seven", "'seven' is not a valid module ident"),
        ("module plug axis-01", "SLOT"),
    ],
)
def test_a_place_or_module_that_is_none_is_bad_input_and_nothing_is_asked(ask, farm, line, told):
    found = ask(*line.split())
    assert found.code == 2
    assert told in found.err
    assert farm.asked == []


def test_what_the_farm_says_of_a_module_is_the_commands_sentence(ask, farm):
    farm.answer("DELETE", "drives/axis-01/modules/0", {"detail": "slot 0 holds the access point"}, 422)
    found = ask("module", "pull", "axis-01", "0")
    assert (found.code, found.err) == (2, "pnfarm: slot 0 holds the access point\n")


def test_module_alone_shows_its_help(ask):
    found = ask("module")
    assert all(word in found.out for word in ("list", "pull", "plug"))
