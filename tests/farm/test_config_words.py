"""Patterns that count, durations and cycles."""

from ipaddress import IPv4Interface

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.profinet.config.clock import (
    CYCLE_UNIT_NS,
    check_clock,
    join_cycle,
    nearest_cycles,
    split_cycle,
)
from pnfarm.config.values import expand_name, numbered
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.vocabulary.durations import format_duration, parse_duration
from pnfarm.wire.rtc import REDUCTION_RATIOS, SEND_CLOCK_FACTORS

# --- patterns ---------------------------------------------------------------------------------------------------


@given(n=st.integers(0, 10**6), width=st.integers(1, 9), head=st.from_regex(r"[a-z]{1,5}", fullmatch=True))
def test_a_pattern_counts_with_leading_zeros_and_loses_no_digit(n, width, head):
    name = expand_name(f"{head}-{{n:0{width}}}", n)
    assert int(name.removeprefix(f"{head}-")) == n
    assert len(name) == len(head) + 1 + max(width, len(str(n)))
    assert expand_name(f"{head}-{{n}}", n) == f"{head}-{n}"


def test_a_pattern_may_count_in_several_places_or_in_none():
    assert expand_name("line-{n}.axis-{n:02}", 3) == "line-3.axis-03"
    assert not numbered("press")
    assert expand_name("press", 3) == "press"


@given(count=st.integers(1, 60), start=st.integers(0, 5000), host=st.integers(1, 194))
def test_a_group_counts_names_addresses_and_macs_in_step(count, start, host):
    drives = expand(
        parse_farm(
            f"farm: f\nlink: {{kind: memory}}\ndrives: [{{name: 'd{{n}}', model: akd-profinet, count: {count}, "
            f"start: {start}, ip: 10.1.2.{host}/24, mac: '02:00:00:00:00:00'}}]"
        )
    )
    assert [drive.name for drive in drives] == [f"d{n}" for n in range(start, start + count)]
    assert [drive.ip for drive in drives] == [IPv4Interface(f"10.1.2.{host + i}/24") for i in range(count)]
    assert [int.from_bytes(drive.mac, "big") for drive in drives] == [(2 << 40) + i for i in range(count)]


@given(st.lists(st.from_regex(r"[a-z]{1,6}", fullmatch=True), min_size=1, max_size=20, unique=True))
def test_automatic_macs_are_unicast_local_and_unique(names):
    groups = ", ".join(f"{{name: '{name}-{{n}}', count: 9, model: akd-profinet}}" for name in names)
    macs = [drive.mac for drive in expand(parse_farm(f"farm: f\nlink: {{kind: memory}}\ndrives: [{groups}]"))]
    assert len(set(macs)) == len(macs) == 9 * len(names)
    assert all(mac[0] & 3 == 2 for mac in macs)


# --- cycles -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "clock"),
    [
        ("31.25us", (1, 1)),
        ("250us", (8, 1)),
        ("1ms", (32, 1)),
        ("2ms", (32, 2)),
        ("16ms", (32, 16)),
        ("512ms", (32, 512)),
    ],
)
def test_a_cycle_is_split_with_a_send_clock_of_one_millisecond_where_it_can(text, clock):
    assert split_cycle(parse_duration(text)) == clock


@given(st.sampled_from(SEND_CLOCK_FACTORS), st.sampled_from(REDUCTION_RATIOS))
def test_every_allowed_pair_makes_a_cycle_that_splits_again(factor, ratio):
    if check_clock(factor, ratio) is None:
        cycle_ns = join_cycle(factor, ratio)
        again = split_cycle(cycle_ns)
        assert check_clock(*again) is None
        assert join_cycle(*again) == cycle_ns
    else:
        assert factor * ratio > 1 << 14


@given(st.integers(0, 2 * 10**9))
def test_the_nearest_cycles_enclose_any_time(cycle_ns):
    nearest = nearest_cycles(cycle_ns)
    assert all(split_cycle(near) for near in nearest)
    if len(nearest) == 2:
        assert nearest[0] < cycle_ns < nearest[1] == 2 * nearest[0]
        with pytest.raises(ValueError, match=format_duration(nearest[0])):
            split_cycle(cycle_ns)
    assert nearest[0] % CYCLE_UNIT_NS == 0
