"""``pnfarm io`` and ``pnfarm trace --list`` with the models of a plant."""

import json
from types import SimpleNamespace

import httpx
import pytest
from api_client import Farm
from api_world import Served

from pnfarm.terminal import client
from pnfarm.testing import Line

FARM = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24}
plant:
  models:
  - {name: gripper, kind: cylinder, time: 20ms}
  - {name: lamp, kind: lamp}
  wires: [gripper.extended -> lamp.on]
"""


@pytest.fixture(scope="module")
def shared():
    with Line.from_text(FARM) as line:
        line.run(0.01)
        served = Served(SimpleNamespace(farm=line.core, world=SimpleNamespace(now=line.now_ns)))
        served.own = line
        yield served


@pytest.fixture
def world(shared, monkeypatch):
    monkeypatch.setattr(httpx, "Client", Farm(shared).client)
    return shared


def test_models_are_listed_written_and_forced_as_devices_are(pnfarm, world):
    done = pnfarm("io", "gripper.extend=on")
    assert (done.code, done.out) == (0, "gripper.extend = true\n")
    world.own.run(0.1)
    assert pnfarm("io", "gripper.position", "lamp.on").out == "gripper.position = 1.0\nlamp.on = true\n"
    _, first, *_ = [line.split() for line in pnfarm("io", "gripper").out.splitlines()]
    assert first == ["gripper", "extend", "input", "bool", "true", "good", "value", "plant"]
    assert {line.split()[0] for line in pnfarm("io").out.splitlines()[1:]} == {"gripper", "lamp"}
    done = pnfarm("io", "lamp.on=off")
    assert (done.code, "has a wire, which writes it" in done.err) == (2, True)
    assert "did you mean gripper?" in pnfarm("io", "griper").err


def test_ports_are_listed_for_traces(pnfarm, world):
    done = pnfarm("trace", "gripper", "--list", "--format", "json")
    (found,) = json.loads(done.out)["drives"]
    assert [one["signal"] for one in found["signals"]][:4] == ["extend", "retract", "stuck", "position"]


def test_the_live_stream_follows_a_model(world):
    answer = world.get("/api/v1/live?device=gripper&overview=false&follow=false")
    assert answer.status_code == 200
    assert '"device":"gripper"' in answer.text
    assert '"device":"lamp"' not in answer.text
    every = world.get("/api/v1/live?device=all&overview=false&follow=false").text
    assert '"device":"lamp"' in every
    assert world.get("/api/v1/live?device=griper&overview=false&follow=false").status_code == 404


def test_a_port_of_an_fmu_may_have_dots_in_its_name(pnfarm, monkeypatch):
    port = {"name": "body.x", "unit": "m", "shown": "1.5", "owner": "plant", "good": True}
    answers = {
        ("devices",): {"devices": []},
        ("plant",): {"models": [{"name": "press"}]},
        ("devices", "press", "signals"): {"device": "press", "signals": [port]},
    }
    monkeypatch.setattr(client.FarmClient, "get", lambda _, *path: answers[path])
    assert pnfarm("io", "press.body.x").out == "press.body.x = 1.5 m\n"
