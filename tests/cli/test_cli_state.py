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
