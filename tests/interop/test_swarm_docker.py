"""compose.swarm.yaml as it is on three Docker engines: 96 drives in three shards, machines lost and come back."""

import os

import pytest
from swarm_stack import SHARDS, eventually, made_stack

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.environ.get("PNFARM_DOCKER") != "1", reason="asked for with PNFARM_DOCKER=1: takes minutes"),
]
#: A test is repeated with the swarm as it is.
KEEPS_FIXTURES = True


@pytest.fixture(scope="module")
def stack():
    yield from made_stack()


def test_every_drive_of_every_shard_is_run_by_the_controller(stack, tell):
    _, seconds = eventually(stack.all_work, 240)
    tell("from the deployed stack until all drives are in operation", seconds)
    assert sorted(stack.shards()) == list(range(1, SHARDS + 1))
    clocks = [shard["offset_uncertainty_seconds"] for shard in stack.ask("health")["shards"]]
    tell("the hub knows the shards' clocks to within", max(clocks))
    drives = stack.drives()
    for shard in range(1, SHARDS + 1):
        assert {drives[name]["controller"]["name"] for name in stack.names_of(shard)} == {"plc"}


def test_one_fault_over_a_glob_hits_drives_of_all_shards(stack):
    eventually(stack.all_work)
    names = [name for name in stack.names if name.startswith("axis-01")]
    before = stack.drives()
    made = stack.ask("faults", "POST", {"kind": "timeout", "on": "axis-01*"})

    def is_over():
        fault = stack.ask(f"faults/{made['id']}")
        return fault["state"] == "ended" and fault

    fault, _ = eventually(is_over)
    assert fault["evidence"]["activations"] >= len(names)
    eventually(stack.all_work)
    after = stack.drives()
    assert all(after[name]["connects"] > before[name]["connects"] for name in names)
    assert {name: after[name]["last_fault"]["number"] for name in names} == dict.fromkeys(names, 702)


def test_prometheus_finds_the_shards_and_the_hub_by_their_names(stack):
    manager = stack.swarm.manager
    (container,) = manager.containers("pnfarm_prometheus")

    def up():
        query = "sum by (job) (up)"
        said = manager.docker("exec", container, "promtool", "query", "instant", "http://127.0.0.1:9090", query)
        # before the first scrape there is nothing
        return {words[0]: words[2] for words in map(str.split, said.splitlines()) if len(words) > 2}

    eventually(lambda: up() == {'{job="pnfarm"}': str(SHARDS), '{job="pnfarm-hub"}': "1"})


def test_a_killed_engine_stops_no_drive_and_as_it_comes_back_another_node_has_them(stack, tell):
    eventually(stack.all_work)
    shards = stack.shards()
    kept = (stack.swarm.manager, stack.node_of_hub())
    number, node = next((n, node) for n, node in sorted(shards.items()) if node not in kept)
    names = stack.names_of(number)
    drive = names[0]
    accelerated = stack.param(drive, "DRV.ACC") + 1000
    stack.param(drive, "DRV.ACC", accelerated)
    stack.param(drive, "DRV.NVSAVE", 1)
    node.kill()
    _, seconds = eventually(lambda: stack.state_of(node) == "down")
    tell("from the engine's end until the swarm says so", seconds)
    # the swarm starts the shard once more; its containers run on, and keep their lease
    eventually(lambda: number in stack.shards())
    eventually(stack.all_work)
    node.start()
    _, seconds = eventually(stack.all_work, 90)
    place = stack.shards()[number]
    assert place is not node
    tell("from the killed engine's return, which ends its containers, until all drives are in operation", seconds)
    eventually(lambda: {found[-1] for found in stack.places(names).values()} == {place.number})
    assert stack.param(drive, "DRV.ACC") == accelerated
    tell("silent on the wire meanwhile, at most", stack.silence(names))
    assert stack.spoke_twice() == {}


def test_a_lost_machines_drives_are_back_elsewhere_with_their_memory(stack, tell):
    eventually(stack.all_work)
    node = next(node for node in stack.shards().values() if node is not stack.swarm.manager)
    numbers = [number for number, place in stack.shards().items() if place is node]
    names = [name for number in numbers for name in stack.names_of(number)]
    before = stack.places(names)
    accelerated = {name: stack.param(name, "DRV.ACC") + 2000 for name in names[:3]}
    for name, value in accelerated.items():
        stack.param(name, "DRV.ACC", value)
        stack.param(name, "DRV.NVSAVE", 1)
    node.crash()
    _, seconds = eventually(stack.all_work, 120)
    tell(f"from the loss of a machine with {len(names)} drives until all are in operation elsewhere", seconds)
    assert {name: stack.param(name, "DRV.ACC") for name in accelerated} == accelerated
    node.revive()
    eventually(lambda: stack.state_of(node) == "ready")
    eventually(stack.all_work)
    assert node not in stack.shards().values()
    after = stack.places(names)
    for name in names:
        # one place more, and it stays there
        assert len(after[name]) == len(before[name]) + 1, after[name]
        assert after[name][-1] != node.number
