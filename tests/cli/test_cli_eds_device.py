"""Commands on a farm with a device by its EDS file, against its API in virtual time."""

import asyncio
import json

import httpx
import pytest
from api_client import Farm
from device_cell import CONFIGS

from pnfarm.api import make_app
from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import load_farm

FILE = CONFIGS / "weigher.pnfarm.yml"


class World:
    """The example farm behind its API."""

    def __init__(self):
        self.line = asyncio.run(VirtualLine.create(load_farm(FILE)))
        farm, world = self.line.farm, self.line.world
        assert world.run(10.0, until=lambda: self.line.plc.all_connected)
        world.run(0.1)
        self.app = make_app(farm, now=lambda: world.now, poke=lambda: farm.service(world.now))


@pytest.fixture(scope="module")
def shared():
    return World()


@pytest.fixture
def world(shared, monkeypatch):
    monkeypatch.setattr(httpx, "Client", Farm(shared).client)
    return shared


def test_validate_shows_what_was_taken_from_the_file(pnfarm):
    done = pnfarm("validate", FILE)
    assert done.code == 0
    assert "weigher: EX-WGH Weigher (EX-WGH-1), Connection1: Exclusive owner" in done.out


def test_values_are_listed_and_written_by_name_and_reach_the_scanner(pnfarm, world):
    done = pnfarm("io", "weigher.slot102_weight=2.5", "weigher.slot102_stable=on")
    assert (done.code, done.out) == (0, "weigher.slot102_stable = true\nweigher.slot102_weight = 2.5 kg\n")
    world.line.world.run(0.1)
    assert world.line.plc.inputs("weigher")[:8] == bytes([1, 0, 0, 0]) + (2500).to_bytes(4, "little")
    rows = [line.split() for line in pnfarm("io").out.splitlines()]
    assert ["weigher", "tare", "output", "bool", "false", "good", "controller", "101.1.0.0"] in rows


def test_inspect_shows_identity_assemblies_and_connection(pnfarm, world):
    done = pnfarm("inspect", "weigher", "--format", "json")
    assert done.code == 0
    found = json.loads(done.out)
    assert (found["identity"]["product_code"], found["identity"]["revision"]) == (17, "2.5")
    assert [(one["slot"], one["name"]) for one in found["modules"]][:2] == [(102, "Inputs"), (101, "Outputs")]
    assert found["connected"]
    assert "EX-WGH Weigher" in pnfarm("inspect", "weigher").out
