"""A whole farm in shards behind the hub, in virtual time; ``python -m tests.swarm`` does the same with a thousand."""

import re

import pytest
from swarm_world import Claim, SwarmWorld, simulate


@pytest.fixture(scope="module")
def report():
    return simulate(SwarmWorld(20, 2, cycle=64), faults=3, seed=1)


def test_start_storm_and_a_lost_shard_leave_every_drive_in_operation_with_its_memory(report):
    assert report.wrong == []
    assert (report.drives, report.shards, report.faults, report.hits, report.lost) == (20, 2, 3, 29, 10)


def test_the_second_copy_runs_once_the_first_ones_claims_have_ended(report):
    # 5 s to live, a look each second, and the drives' start
    assert 5 <= report.seconds_to_take_over <= 12


@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        ("memory", "10 drives came back without what they had saved, such as axis-00-0002"),
        ("claims", "a second copy ran while the first one's claims were in force"),
        ("fault", r"(f702|timeout) on \*\d\?: 201, \d+ drives"),
    ],
)
def test_the_simulation_notices(broken, sentence, monkeypatch):
    world = SwarmWorld(20, 2, cycle=64)
    if broken == "memory":
        monkeypatch.setattr(world.memory, "load", lambda station: None)
    elif broken == "claims":
        monkeypatch.setattr(Claim, "ask", lambda self, holder, ttl_ns, now: "1")
    else:
        reach = world.request

        def one_less(method, path, **options):
            answer = reach(method, path, **options)
            if path == "faults":
                fault = answer.json()
                fault["drives"].popitem()
                monkeypatch.setattr(answer, "json", lambda: fault)
            return answer

        monkeypatch.setattr(world, "request", one_less)
    report = simulate(world, faults=3, seed=1)
    assert any(re.fullmatch(sentence, wrong) for wrong in report.wrong), report.wrong
