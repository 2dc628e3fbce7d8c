"""``pnfarm state`` against the API of a farm in virtual time."""

import httpx
from api_client import Farm
from api_world import ApiWorld

from pnfarm.api import make_app
from pnfarm.farm.state.states import SavedStates


def test_commands_save_restore_list_and_delete(pnfarm, monkeypatch, tmp_path):
    world = ApiWorld(1)
    farm, clock = world.line.farm, world.line.world
    world.app = make_app(farm, now=lambda: clock.now, states=SavedStates(farm, tmp_path, lambda: clock.now))
    monkeypatch.setattr(httpx, "Client", Farm(world).client)
    done = pnfarm("state", "save", "mid")
    assert (done.code, done.out.splitlines()[0]) == (0, "saved mid")
    assert pnfarm("state", "list").out.splitlines()[1].split()[0] == "mid"
    assert pnfarm("state", "restore", "mid", "--check").out == "mid can be restored\n"
    assert pnfarm("state", "restore", "mid").out.splitlines()[0] == "restored mid"
    assert pnfarm("state", "delete", "mid").out == "deleted mid\n"
    assert pnfarm("state", "list").out == "the farm has no saved states\n"
    refused = pnfarm("state", "restore", "mid")
    assert (refused.code, refused.err.count("\n")) == (2, 1)
    assert "there is no state mid" in refused.err


def test_a_state_that_is_not_there_ends_up_before_the_drives_begin(process, tmp_path):
    file = tmp_path / "a.pnfarm.yml"
    file.write_text(
        "farm: a\nlink: {kind: memory}\napi: off\nstate: kept\n"
        "drives: [{name: press, model: akd-profinet, ip: 10.77.0.11/24}]\ncontroller: {ip: 10.77.0.1/24}\n",
        "utf-8",
    )
    ended = process("up", file, "--restore", "loaded")
    assert ended.code == 2
    assert "there is no state loaded" in ended.err
    assert "press" not in ended.err
