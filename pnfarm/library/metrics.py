"""A farm's metrics at one moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable

    from prometheus_client import Metric

__all__ = ["Metrics"]


class Metrics:
    """All samples of one scrape, in base units as in ``/metrics`` (docs/metrics.md)."""

    def __init__(self, families: Iterable[Metric]) -> None:
        self._samples: dict[str, list[tuple[dict[str, str], float]]] = {}
        for family in families:
            for sample in family.samples:
                self._samples.setdefault(sample.name, []).append((dict(sample.labels), float(sample.value)))

    @property
    def names(self) -> list[str]:
        """Names of all samples; a histogram has those that end with ``_bucket``, ``_sum`` and ``_count``."""
        return sorted(self._samples)

    def value(self, name: str, **labels: str) -> float:
        """The sum of the series of this name whose labels fit: ``value("pnfarm_axis_faults_total", drive="axis-01")``.

        Raises :class:`ConfigError` for a name or labels that no series has.
        """
        series = self._samples.get(name)
        if series is None:
            raise ConfigError(f"there is no metric {name}{did_you_mean(name, self._samples)}")
        found = [value for known, value in series if all(known.get(key) == wanted for key, wanted in labels.items())]
        if not found:
            shown = ", ".join(f'{key}="{wanted}"' for key, wanted in labels.items())
            raise ConfigError(f"{name} has no series with {shown}")
        return sum(found)

    def __contains__(self, name: object) -> bool:
        return name in self._samples

    def __repr__(self) -> str:
        return f"<Metrics: {len(self._samples)} names>"
