"""What a swarm goes on without: its database restarted and cut off, its hub killed, a node cut off from the others."""

import os
import time

import pytest
from swarm_stack import eventually, made_stack

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.environ.get("PNFARM_DOCKER") != "1", reason="asked for with PNFARM_DOCKER=1: takes minutes"),
]
#: A test is repeated with the swarm as it is.
KEEPS_FIXTURES = True
CUT_SECONDS = 30


@pytest.fixture(scope="module")
def stack():
    yield from made_stack()


@pytest.fixture(autouse=True)
def all_work(stack):
    eventually(stack.all_work, 240)


def test_a_killed_hub_is_back_and_knows_the_faults_in_force(stack, tell):
    made = stack.ask("faults", "POST", {"kind": "silence", "on": "axis-01*", "as": "quiet"})
    node = stack.node_of_hub()
    (container,) = node.containers("pnfarm_hub")
    before = stack.drives()
    node.docker("kill", container)
    # it finds the shards one after another
    _, seconds = eventually(lambda: sorted(stack.ask("faults/quiet")["drives"]) == sorted(made["drives"]))
    tell("from the hub's death until it has the fault with all its drives again", seconds)
    stack.ask("faults/quiet", "DELETE")
    eventually(stack.all_work)
    after = stack.drives()
    others = [name for name in stack.names if name not in made["drives"]]
    # a stalled machine may lose one: those are the farm's own, or the controller's, of which a farm knows nothing
    lost = {
        name: after[name]["connects"] - before[name]["connects"]
        - (after[name]["aborts_by_farm"] - before[name]["aborts_by_farm"])
        for name in others
    }  # fmt: skip
    assert sum(max(0, count) for count in lost.values()) <= len(others) // 10, lost


def test_a_restarted_database_is_found_again(stack, tell):
    drive = stack.names[0]
    value = stack.param(drive, "DRV.ACC") + 1000
    (container,) = stack.swarm.manager.containers("pnfarm_db")
    stack.swarm.manager.docker("kill", container)

    def saved():
        stack.param(drive, "DRV.ACC", value)
        stack.param(drive, "DRV.NVSAVE", 1)
        return stack.all_work()

    _, seconds = eventually(saved, 90)
    tell("from the database's death until saves succeed and all drives are in operation", seconds)
    assert stack.param(drive, "DRV.ACC") == value


def test_a_database_that_is_cut_off_mutes_the_drives_and_they_come_back_with_it(stack, tell):
    manager = stack.swarm.manager
    (container,) = manager.containers("pnfarm_db")
    began = time.monotonic()
    # no answer, and no end of any connection
    manager.docker("pause", container)
    try:
        eventually(lambda: not stack.working(), 30)
        tell("from the database's last answer until all drives are mute", time.monotonic() - began)
        places = stack.shards()
        # the database has to be away for the whole time
        time.sleep(max(0.0, CUT_SECONDS - (time.monotonic() - began)))
    finally:
        manager.docker("unpause", container)
    _, seconds = eventually(stack.all_work, 90)
    tell(f"from its return after {CUT_SECONDS} s until all drives are in operation", seconds)
    # nothing was started elsewhere, and no shard was killed for its silence
    assert stack.shards() == places
    assert stack.spoke_twice() == {}


def test_a_node_that_is_cut_off_from_the_others_is_mute_before_another_one_has_its_drives(stack, tell):
    kept = (stack.swarm.manager, stack.node_of_hub())
    number, node = next((n, node) for n, node in sorted(stack.shards().items()) if node not in kept)
    names = stack.names_of(number)
    before = stack.places(names)
    began = time.monotonic()
    # the fieldbus stays plugged: nothing but the lease keeps its containers from speaking on
    node.cable("mgmt", "down")
    try:
        eventually(lambda: not set(names) & set(stack.working()), 60)
        eventually(lambda: stack.state_of(node) == "down")
        tell("from the cut until the swarm says so", time.monotonic() - began)
        eventually(stack.all_work, 120)
        tell(f"from the cut until its {len(names)} drives are in operation elsewhere", time.monotonic() - began)
        assert node.containers("pnfarm_farm"), "its own container runs on, and is mute"
    finally:
        node.cable("mgmt", "up")
    eventually(lambda: stack.state_of(node) == "ready")
    eventually(stack.all_work)
    after = stack.places(names)
    for name in names:
        assert len(after[name]) == len(before[name]) + 1, after[name]
        assert after[name][-1] != node.number
    tell("silent on the wire meanwhile, at most", stack.silence(names))
    assert stack.spoke_twice() == {}
