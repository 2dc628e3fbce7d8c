"""A duration is the same word wherever a user writes one."""

import json

import pytest
from farm_file import GOOD, KNOWN
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds
from pnfarm.cli.plc_device import one_device
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.vocabulary.durations import format_duration, format_measured, parse_duration, read_duration
from pnfarm.vocabulary.problem import Problem

KINDS = fault_kinds()


def in_realism(text):
    config = parse_farm(GOOD + f"    realism: {{parameter_latency: {text}}}\n", known=KNOWN)
    return config.drives[0].realism.parameter_latency[0]


def in_an_impairment(text):
    config = parse_farm(GOOD.replace("impair: []", f"impair: [{{kind: loss, for: {text}}}]"), known=KNOWN)
    return config.drives[0].impair[0].for_ns


def in_the_controller(text):
    return parse_farm(
        GOOD + f"controller: {{reconnect: {{after: {text}}}}}\n", known=KNOWN
    ).controller.reconnect.after_ns


def as_a_cycle(text):
    text = GOOD.replace("strict", "lax") + f"controller: {{cycle: {text}}}\n"
    return parse_farm(text, known=KNOWN).controller.cycle_ns


def as_an_override(text):
    config = parse_farm(GOOD + "controller: {}\n", known=KNOWN)
    return config.with_overrides({"controller.program.dwell": text}).controller.program.dwell_ns


def of_a_device_by_options(text):
    config = one_device("a.xml", device="a", ip="10.0.0.2/24", interface="eth0", dap=None, modules=(), cycle=text)
    return config.controller.devices[0].cycle_ns


def in_an_injection(text):
    return KINDS.parse({"kind": "loss", "on": "all", "for": text}).for_ns


def as_a_parameter_of_an_injection(text):
    return KINDS.parse({"kind": "late-application-ready", "on": "all", "params": {"delay": text}}).values()["delay"]


PLACES = [
    in_realism,
    in_an_impairment,
    in_the_controller,
    as_a_cycle,
    as_an_override,
    of_a_device_by_options,
    in_an_injection,
    as_a_parameter_of_an_injection,
]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    ("text", "duration_ns"),
    [
        ("16ms", 16_000_000),
        ("16 ms", 16_000_000),
        ("0.016s", 16_000_000),
        ("31.25us", 31_250),
        ("31.25 \u00b5s", 31_250),
        ("31.25 \u03bcs", 31_250),
        ("62500ns", 62_500),
    ],
)
def test_every_spelling_of_a_duration_is_read_in_every_place(place, text, duration_ns):
    if place is of_a_device_by_options and duration_ns < 1_000_000:
        text, duration_ns = text.replace("31.25", "1000").replace("62500ns", "1000000ns"), 1_000_000
    assert place(text) == duration_ns


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("5 parsec", "'5 parsec' is not a duration; allowed: a number with a unit, such as 500ms, 2s or 31.25us"),
        ("1.5ns", "'1.5ns' is not a duration; allowed: whole nanoseconds"),
        ("400000h", "'400000h' is not a duration; allowed: at most a year"),
    ],
)
def test_a_wrong_duration_is_reported_in_the_same_words_in_every_place(place, text, told):
    with pytest.raises(ConfigError) as caught:
        place(text)
    assert told in str(caught.value)


# realism, which takes other words than durations, too, tells of them all
@pytest.mark.parametrize("place", [place for place in PLACES if place is not in_realism])
def test_a_number_without_a_unit_is_no_duration_in_any_place(place):
    with pytest.raises(ConfigError, match="is 5, which has no unit"):
        place(json.loads("5"))


@pytest.mark.parametrize(
    ("text", "duration_ns"),
    [
        ("500ms", 500_000_000),
        ("2 s", 2 * 10**9),
        ("31.25us", 31_250),
        ("31.25µs", 31_250),
        ("1.5min", 90 * 10**9),
        ("0s", 0),
    ],
)
def test_durations_are_read_exactly(text, duration_ns):
    assert parse_duration(text) == duration_ns


@pytest.mark.parametrize("text", ["5", "ms", "-1s", "1.5ns", "1e3s", "400000h", "1s2", ""])
def test_other_words_are_no_durations(text):
    with pytest.raises(ValueError, match=r"number|whole|year"):
        parse_duration(text)


@given(st.integers(0, 10**16))
def test_a_duration_is_written_as_it_is_read(duration_ns):
    assert read_duration(format_duration(duration_ns)) == duration_ns


@given(st.one_of(st.none(), st.integers(), st.text(max_size=8), st.floats(), st.booleans()))
def test_any_duration_is_read_or_is_a_problem(value):
    try:
        duration_ns = read_duration(value)
    except Problem:
        return
    assert duration_ns >= 0


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [
        (0.043320265, "43.3 ms"), (0.0, "0 s"), (3.0, "3 s"), (2.504, "2.504 s"), (0.99996, "1 s"), (850e-9, "850 ns"),
        (31.25e-6, "31.2 us"), (999.96e-6, "1 ms"), (-0.004, "-4 ms"), (86400.0, "86400 s"), (12.3456, "12.346 s"),
    ],
)  # fmt: skip
def test_a_measured_time_has_three_digits_and_a_unit(seconds: float, shown: str) -> None:
    assert format_measured(seconds) == shown
