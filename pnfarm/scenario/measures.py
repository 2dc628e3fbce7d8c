"""Metrics as expectations see them: sums of series, increases, quantiles of a histogram over a period."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.steps import QUANTILES
from pnfarm.vocabulary.durations import format_measured
from pnfarm.vocabulary.quantities import show_quantity
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from prometheus_client import Metric

    from pnfarm.metrics import FarmCollector
    from pnfarm.scenario.definition.steps import Bound, MetricName

__all__ = ["Reading", "check_metric", "measured", "read_metric", "reading_of", "show_comparison", "show_value"]

#: Sum of the matching series by sample name, and for buckets also by upper bound.
Reading = dict[tuple[str, str], float]


def read_metric(collector: FarmCollector, wanted: MetricName) -> Reading:
    """The samples of a metric whose labels fit, added up."""
    return reading_of(collector.gather().metrics(wanted.name), wanted)


def reading_of(families: Iterable[Metric], wanted: MetricName) -> Reading:
    """The same of families that were read elsewhere."""
    found: Reading = {}
    names = {wanted.name, *(f"{wanted.name}_{part}" for part in ("bucket", "sum", "count"))}
    for family in families:
        if not wanted.name.startswith(family.name):
            continue
        for sample in family.samples:
            if sample.name in names and all(sample.labels.get(key) == value for key, value in wanted.labels.items()):
                key = (sample.name.removeprefix(wanted.name), sample.labels.get("le", ""))
                found[key] = found.get(key, 0.0) + sample.value
    return found


def check_metric(collector: FarmCollector, wanted: MetricName, asked: str) -> None:
    """Raises :class:`ConfigError` for a metric that the farm does not have, or one without quantiles."""
    families = list(collector.gather().metrics())
    histograms = {family.name for family in families if family.type == "histogram"}
    names = sorted(histograms.union(sample.name for family in families for sample in family.samples))
    if wanted.name not in names:
        raise ConfigError(f"there is no metric {wanted.name}{did_you_mean(wanted.name, names)}")
    if asked in QUANTILES and wanted.name not in histograms:
        raise ConfigError(
            f"{wanted.name} has no {asked}: it is not a histogram; histograms are {', '.join(histograms)}"
        )
    if asked not in QUANTILES and wanted.name in histograms:
        raise ConfigError(f"{wanted.name} is a histogram: ask for p50, p90 or p99, or for {wanted.name}_count")
    if not reading_of(families, wanted):
        labels = ", ".join(f'{key}="{value}"' for key, value in wanted.labels.items())
        raise ConfigError(f"{wanted.name} has no series with {labels}")


def measured(asked: str, before: Reading, after: Reading) -> float:
    """What was asked: ``increases``, ``value``, a quantile in the metric's unit; NaN where nothing was counted."""
    if asked == "value":
        return after.get(("", ""), math.nan)
    if asked == "increases":
        return after.get(("", ""), math.nan) - before.get(("", ""), 0.0)
    return quantile(QUANTILES[asked], {
        float(bound): value - before.get((name, bound), 0.0)
        for (name, bound), value in after.items()
        if name == "_bucket"
    })  # fmt: skip


#: Units by the last word of a metric's name; in each case the base unit is in the name.
_UNITS = {"rpm": "rpm", "revolutions": "revolutions", "amperes": "A", "celsius": "°C", "bytes": "bytes"}


def show_value(metric: str, value: float, beside: Iterable[float] = ()) -> str:
    """A measured value for people, with the unit that the metric's name has.

    ``beside``: what it was compared with.
    """
    if math.isnan(value):
        return "nothing counted"
    if math.isinf(value):
        return "above the last bound of the histogram"
    name = metric.removesuffix("_sum").removesuffix("_total")
    if name.endswith("_seconds"):
        return format_measured(value, beside)
    return show_quantity(value, _UNITS.get(name.rpartition("_")[2], ""), beside)


def show_comparison(metric: str, value: float, bound: Bound) -> tuple[str, str]:
    """The value, and the sign and the bound, so that what is different looks different."""
    return show_value(metric, value, (bound.value,)), f"{bound.sign} {show_value(metric, bound.value, (value,))}"


def quantile(q: float, cumulative: Mapping[float, float]) -> float:
    """By linear interpolation inside a bucket, as Prometheus's histogram_quantile; infinite above the last bound."""
    total = cumulative.get(math.inf, 0.0)
    if total <= 0:
        return math.nan
    wanted, low, below = q * total, 0.0, 0.0
    for bound in sorted(cumulative):
        if cumulative[bound] >= wanted:
            if math.isinf(bound):
                # how far beyond the last bound it is, is not known
                return math.inf
            inside = cumulative[bound] - below
            return low + (bound - low) * ((wanted - below) / inside if inside else 1.0)
        low, below = bound, cumulative[bound]
    return low
