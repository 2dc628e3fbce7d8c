"""Faults over several shards: one id, one evidence, one moment; a hub that was restarted; shards that are away."""

import httpx
import pytest
from api_world import assert_problem
from hub_world import HubWorld


@pytest.fixture
def world():
    return HubWorld(("axis-{n:02}", 2), ("pump-{n:02}", 2), skews=(0.0, 40.0))


def test_a_glob_hits_drives_of_all_shards_under_one_id_at_one_moment(world):
    answer = world.post("faults", {"kind": "silence", "on": "*-01", "as": "quiet"})
    assert answer.status_code == 201
    fault = answer.json()
    assert (fault["id"], fault["state"], list(fault["drives"])) == ("quiet", "active", ["axis-01", "pump-01"])
    assert (fault["partial"], fault["not_hit"], fault["hit"]) == (False, [], ["axis-01", "pump-01"])
    assert fault["spec"]["on"] == ["*-01"]
    # the two clocks are 40 s apart: by the hub's they began together, within the engines' millisecond
    starts = [run["started_seconds"] for run in fault["drives"].values()]
    assert abs(starts[0] - starts[1]) < 0.003
    assert starts[0] == pytest.approx(world.clock_ns / 1e9, abs=0.05)
    (listed,) = world.get("faults").json()["faults"]
    assert list(listed["drives"]) == ["axis-01", "pump-01"]
    gone = world.request("DELETE", "faults/quiet")
    assert (gone.status_code, gone.json()["state"]) == (200, "ended")
    assert world.get("faults").json() == {"faults": [], "partial": False, "unreachable": []}
    assert world.get("faults/quiet").json()["state"] == "ended"
    assert_problem(world.get("faults/quite"), 404, "quite")


def test_evidence_is_summed_and_confirmed_only_on_every_drive():
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), controller=True)
    world.run(3)
    world.probe()
    fault = world.post("faults", {"kind": "f702", "on": "all", "as": "trip"}).json()
    world.run(0.2)
    fault = world.get("faults/trip").json()
    assert fault["evidence"]["activations"] == 2
    assert fault["evidence"]["confirmed"] is all(run["evidence"]["confirmed"] for run in fault["drives"].values())


def test_share_most_and_seed_choose_among_all_drives_as_one_farm_does():
    whole = HubWorld(("axis-{n:02}", 8))
    parts = HubWorld(("axis-0{n}", 4), ("bxis-0{n}", 4))
    body = {"kind": "silence", "on": "all", "most": 3, "seed": 7}
    one = whole.post("faults?dry_run=true", body).json()
    assert len(one["drives"]) == 3
    found = parts.post("faults?dry_run=true", body).json()
    assert (len(found["drives"]), len(found["left_out"])) == (3, 5)
    assert found["spec"]["seed"] == 7
    # the choice is by name and seed: the shards take no part in it
    from pnfarm.faults.targets import _rank

    ranked = sorted(parts.hub.shards.names, key=lambda name: _rank(type("S", (), {"seed": 7}), name))
    assert set(found["drives"]) == set(ranked[:3])
    assert parts.post("faults", body).json()["hit"] == found["drives"]
    # without a seed one is made up, and told, so that the run can be repeated
    assert parts.post("faults?dry_run=true", {"kind": "silence", "on": "all", "share": "50%"}).json()["spec"]["seed"]


def test_a_hub_that_was_killed_finds_the_faults_again(world):
    for name in ("quiet", None):
        body = {"kind": "silence", "on": "*-02"} | ({"as": name} if name else {})
        world.post("faults", body)
    before = world.get("faults").json()["faults"]
    world.restart_hub()
    after = world.get("faults").json()["faults"]
    assert [fault["id"] for fault in before] == [fault["id"] for fault in after]
    assert [list(fault["drives"]) for fault in after] == [["axis-02", "pump-02"]] * 2
    assert world.request("DELETE", f"faults/{after[1]['id']}").json()["state"] == "ended"


def test_faults_injected_at_a_shard_keep_apart(world):
    for number in (1, 2):
        world[number].farm.injections.inject({"kind": "silence", "on": "all"}, world[number].line.world.now)
    found = world.get("faults").json()["faults"]
    assert [fault["id"] for fault in found] == ["fault-1@s1:8702", "fault-1@s2:8702"]
    assert_problem(world.get("faults/fault-1"), 404, "fault-1@HOST:PORT")
    assert world.request("DELETE", "faults/fault-1@s2:8702").json()["state"] == "ended"
    assert [fault["id"] for fault in world.get("faults").json()["faults"]] == ["fault-1@s1:8702"]


def test_what_one_drive_cannot_is_injected_into_none(world):
    body = {"kind": "silence", "on": "all", "when": "no_such_signal > 1"}
    assert_problem(world.post("faults", body), 422, "no_such_signal")
    assert_problem(world.post("faults", {"kind": "silense", "on": "all"}), 422, "did you mean silence?")
    assert_problem(world.post("faults", {"kind": "silence", "on": "axes-*"}), 422, "no drive matches")
    assert world.post("faults", {"kind": "silence", "on": "pump-01", "as": "mine"}).status_code == 201
    # the name is taken on one shard: the others get nothing
    assert_problem(world.post("faults", {"kind": "silence", "on": "all", "as": "mine"}), 422, "mine")
    assert [list(fault["drives"]) for fault in world.get("faults").json()["faults"]] == [["pump-01"]]


def test_a_name_in_force_is_taken_for_drives_of_any_shard(world):
    first = world.post("faults", {"kind": "silence", "on": "axis-01", "as": "mine"}).json()
    world.run(20)
    for on in ("axis-01", "pump-01"):
        assert_problem(world.post("faults", {"kind": "loss", "on": on, "as": "mine"}), 422, "'mine' is in force")
    (shown,) = world.get("faults").json()["faults"]
    assert (shown["kind"], shown["spec"], list(shown["drives"])) == ("silence", first["spec"], ["axis-01"])
    assert world.request("DELETE", "faults/mine").status_code == 200
    assert world.post("faults", {"kind": "loss", "on": "pump-01", "as": "mine"}).status_code == 201


def test_what_is_refused_does_not_change_what_is_shown_as_asked_for(world):
    world.post("faults", {"kind": "silence", "on": "axis-01", "as": "mine"})
    # as if it had begun behind the hub's look at the names
    world[1].trouble = lambda request: httpx.Response(404 if request.method == "GET" else 422, json={"detail": "taken"})
    assert_problem(world.post("faults", {"kind": "loss", "on": "axis-02", "as": "mine"}), 422, "taken")
    world[1].trouble = None
    assert world.get("faults/mine").json()["spec"]["kind"] == "silence"


def test_a_shard_that_is_away_is_told_by_each_change(world):
    world.post("faults", {"kind": "silence", "on": "all", "as": "before"})
    world.lose(2)
    answer = world.post("faults", {"kind": "silence", "on": "all", "as": "half"})
    assert answer.status_code == 207
    fault = answer.json()
    assert (fault["partial"], fault["hit"]) == (True, ["axis-01", "axis-02"])
    assert [(one["drive"], one["shard"]) for one in fault["not_hit"]] == [
        ("pump-01", "s2:8702"),
        ("pump-02", "s2:8702"),
    ]
    assert "refuses the connection" in fault["not_hit"][0]["why"]
    found = world.get("faults").json()
    assert (found["partial"], [one["shard"] for one in found["unreachable"]]) == (True, ["s2:8702"])
    # what was in force there is not shown as over
    assert {one["id"]: one["unreachable"] for one in found["faults"]} == {
        "before": ["pump-01", "pump-02"],
        "half": [],
    }
    reset = world.post("reset")
    assert (reset.status_code, reset.json()["cleared"], reset.json()["partial"]) == (207, ["before", "half"], True)
    # the one of the shard that is away is still there, and cannot be named anew
    assert world.get("faults/before").json()["state"] == "active"
    assert_problem(world.post("faults", {"kind": "silence", "on": "all", "as": "before"}), 422, "does not answer")
    assert_problem(world.request("DELETE", "faults/nowhere"), 503, "not known is the rest")
    assert_problem(world.post("faults", {"kind": "silence", "on": "pump-01"}), 503, "no drive was hit")
    world[2].trouble = None
    world.probe()
    assert world.get("faults/before").json()["drives"]["pump-01"]["state"] == "active"
    assert world.request("DELETE", "faults/before").status_code == 200
    assert world.get("faults").json() == {"faults": [], "partial": False, "unreachable": []}


def test_a_fault_that_ended_on_a_shard_before_it_was_away_is_ended_as_a_whole(world):
    world.post("faults", {"kind": "silence", "on": "all", "as": "trip"})
    world.request("DELETE", "faults/trip")
    world.run(20)
    world.post("faults", {"kind": "silence", "on": "axis-01", "as": "trip"})
    world.lose(2)
    answer = world.request("DELETE", "faults/trip")
    assert (answer.status_code, answer.json()["unreachable"]) == (200, [])


def test_a_fault_whose_answer_was_lost_is_not_ended_before_its_shard_was_heard(world):
    inner, silent = world[2].inner, [True]

    class AnswersLost(httpx.AsyncBaseTransport):
        async def handle_async_request(self, request):
            answer = await inner.handle_async_request(request)
            if silent[0] and "/faults" in request.url.path and "dry_run" not in str(request.url):
                raise httpx.ReadTimeout("lost")
            return answer

    world[2].inner = AnswersLost()
    begun = world.post("faults", {"kind": "not-ready", "on": "all", "as": "held"})
    assert (begun.status_code, {one["shard"] for one in begun.json()["not_hit"]}) == (207, {"s2:8702"})
    assert [one.id for one in world[2].farm.injections.list()] == ["held"]
    # its answer is lost again
    assert world.request("DELETE", "faults/held").status_code == 207
    silent[0] = False
    world.post("faults", {"kind": "not-ready", "on": "pump-01", "as": "held-2"})
    assert world.request("DELETE", "faults/held").status_code == 200
    assert [one.id for one in world[2].farm.injections.list() if one.state.value != "ended"] == ["held-2"]


def test_a_request_that_comes_after_the_moment_does_nothing_there(world):
    """As one that waited in a machine that was stopped, and goes on."""
    world[2].trips = (9_000_000_000, 500_000)
    fault = world.post("faults", {"kind": "silence", "on": "all", "as": "late"})
    world[2].trips = (500_000, 500_000)
    assert fault.status_code == 207
    assert [one["drive"] for one in fault.json()["not_hit"]] == ["pump-01", "pump-02"]
    assert "after the moment" in fault.json()["not_hit"][0]["why"]
    assert world[2].farm.injections.list() == []


def test_a_time_to_live_is_renewed_on_all_shards(world):
    world.post("faults", {"kind": "silence", "on": "all", "as": "held", "ttl": "10s"})
    first = world.get("faults/held").json()["expires_seconds"]
    world.run(2)
    assert world.post("faults/held/renew").json()["expires_seconds"] > first + 1.5
    world.lose(1, httpx.ConnectError("gone"))
    assert world.post("faults/held/renew").status_code == 207


def test_a_start_can_be_set_by_the_hubs_clock(world):
    at = world.get("clock").json()["farm_seconds"] + 0.5
    fault = world.post(f"faults?at={at}", {"kind": "silence", "on": "all"}).json()
    assert [run["started_seconds"] for run in fault["drives"].values()] == pytest.approx([at] * 4, abs=0.003)
    assert_problem(world.post("faults?at=0", {"kind": "silence", "on": "all"}), 422, "hub's clock")
