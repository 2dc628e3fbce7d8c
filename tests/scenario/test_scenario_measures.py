"""Values of metrics as an expectation measures them and a report shows them."""

from __future__ import annotations

from math import inf, isnan, nan

import pytest

from pnfarm.scenario.measures import measured, quantile, show_value

#: Cumulative, as in a scrape: 4 up to 0.1, 4 more up to 0.2, none up to 0.4, 2 above.
BUCKETS = {0.1: 4.0, 0.2: 8.0, 0.4: 8.0, inf: 10.0}


@pytest.mark.parametrize(
    ("q", "expected"), [(0.1, 0.025), (0.2, 0.05), (0.4, 0.1), (0.5, 0.125), (0.6, 0.15), (0.8, 0.2), (0.9, inf)]
)
def test_a_quantile_lies_in_its_bucket_by_linear_interpolation(q: float, expected: float) -> None:
    assert quantile(q, BUCKETS) == pytest.approx(expected)


def test_a_single_measurement_has_quantiles() -> None:
    assert quantile(0.5, {0.1: 1.0, inf: 1.0}) == pytest.approx(0.05)


def test_a_quantile_of_nothing_is_no_number() -> None:
    assert isnan(quantile(0.5, {}))
    assert isnan(quantile(0.5, dict.fromkeys(BUCKETS, 0.0)))


def test_a_period_counts_what_came_in_it() -> None:
    before = {("", ""): 3.0, ("_bucket", "0.1"): 4.0, ("_bucket", "0.2"): 4.0, ("_bucket", "+Inf"): 4.0}
    after = {("", ""): 5.0, ("_bucket", "0.1"): 4.0, ("_bucket", "0.2"): 8.0, ("_bucket", "+Inf"): 8.0}
    assert measured("value", before, after) == 5.0
    assert measured("increases", before, after) == 2.0
    assert measured("increases", {}, after) == 5.0
    assert measured("p50", before, after) == pytest.approx(0.15)
    assert isnan(measured("value", before, {}))


@pytest.mark.parametrize(
    ("metric", "value", "shown"),
    [
        ("pnfarm_controller_reconnect_seconds", nan, "nothing counted"),
        ("pnfarm_controller_reconnect_seconds", inf, "above the last bound of the histogram"),
        ("pnfarm_controller_reconnect_seconds", 0.025, "25 ms"),
        ("pnfarm_controller_reconnect_seconds_sum", 1.5, "1.5 s"),
        ("pnfarm_axis_velocity_rpm", 22.5, "22.5 rpm"),
        ("pnfarm_axis_temperature_celsius", 40.0, "40 °C"),
        ("pnfarm_received_bytes_total", 1500.0, "1500 bytes"),
        ("pnfarm_axis_state", 4.0, "4"),
    ],
)
def test_a_value_is_shown_in_the_unit_of_its_metric(metric: str, value: float, shown: str) -> None:
    assert show_value(metric, value) == shown
