"""Whether the benchmark `fault-latency` judges its goal by more than chance."""

import random

from pnfarm.bench.latency import meets

LIMIT_MS = 6.0


def times(late, count=1000):
    """So many times, ns, of which ``late`` are above the limit."""
    return [7_000_000] * late + [5_000_000] * (count - late)


def test_one_percent_above_the_limit_meets_the_goal_and_a_few_more_may_be_chance():
    assert meets(times(10), LIMIT_MS)
    assert meets(times(18), LIMIT_MS)


def test_three_percent_above_the_limit_miss_the_goal():
    assert not meets(times(30), LIMIT_MS)


def test_the_same_distribution_as_the_floors_misses_the_goal_in_few_runs_of_a_hundred():
    rng = random.Random(1)
    missed = 0
    for _ in range(200):
        ours, floor = ([int(rng.uniform(1e6, 5e6) + rng.expovariate(1 / 5e5)) for _ in range(900)] for _ in range(2))
        missed += not meets(ours, sorted(floor)[int(900 * 0.99)] / 1e6)
    assert missed <= 10


def test_a_fault_that_takes_half_a_millisecond_longer_than_the_floor_misses_the_goal_in_most_runs():
    rng = random.Random(2)
    missed = 0
    for _ in range(100):
        ours, floor = (
            [int(rng.uniform(1e6, 5e6) + rng.expovariate(1 / 2e5)) + more for _ in range(900)] for more in (500_000, 0)
        )
        missed += not meets(ours, sorted(floor)[int(900 * 0.99)] / 1e6)
    assert missed >= 90
