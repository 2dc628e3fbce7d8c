"""The generator behind probabilities: published numbers, and numbers in their interval."""

from hypothesis import given
from hypothesis import strategies as st

from pnfarm.station.splitmix import SplitMix64


def test_the_generator_gives_the_published_numbers():
    # the reference implementation's output for seed 1234567
    generator = SplitMix64(1234567)
    assert [generator.next_u64() for _ in range(3)] == [6457827717110365317, 3203168211198807973, 9817491932198370423]


@given(st.integers())
def test_uniform_numbers_lie_in_their_interval(seed):
    generator = SplitMix64(seed)
    assert all(0.0 <= generator.uniform() < 1.0 for _ in range(20))
