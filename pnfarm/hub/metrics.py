"""The hub's own metrics; those of drives are the shards', which Prometheus finds by DNS as the hub does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from pnfarm.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.hub.hub import Hub

__all__ = ["HubCollector"]


class HubCollector:
    """Read when it is scraped."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def describe(self) -> list[Metric]:
        """Nothing is read to register it."""
        return []

    def collect(self) -> Iterator[Metric]:
        """As prometheus_client asks for it."""
        hub = self._hub
        info = GaugeMetricFamily("pnfarm_build_info", "Version of the hub.", labels=["version"])
        info.add_metric([__version__], 1)
        up = GaugeMetricFamily("pnfarm_hub_shard_up", "Whether a shard answers.", labels=["shard"])
        drives = GaugeMetricFamily("pnfarm_hub_shard_drives", "Drives of a shard.", labels=["shard"])
        offset = GaugeMetricFamily(
            "pnfarm_hub_clock_offset_seconds", "The clock of a shard's farm minus the hub's.", labels=["shard"]
        )
        bound = GaugeMetricFamily(
            "pnfarm_hub_clock_uncertainty_seconds", "Bound of the offset's error.", labels=["shard"]
        )
        errors = CounterMetricFamily(
            "pnfarm_hub_request_errors", "Requests to a shard that failed.", labels=["shard", "reason"]
        )
        for shard in hub.shards:
            up.add_metric([shard.label], float(shard.asked))
            drives.add_metric([shard.label], len(shard.drives))
            if shard.clock.known:
                offset.add_metric([shard.label], shard.clock.offset_ns / 1e9)
                bound.add_metric([shard.label], shard.clock.uncertainty_ns(hub.now()) / 1e9)
            for reason, count in shard.errors.items():
                errors.add_metric([shard.label, reason], count)
        conflicts = GaugeMetricFamily("pnfarm_hub_conflicts", "Drives that several shards claim.")
        conflicts.add_metric([], len(hub.shards.conflicts()))
        streams = GaugeMetricFamily("pnfarm_hub_streams", "Event streams of clients that are open.")
        streams.add_metric([], len(hub.streams))
        yield from (info, up, drives, offset, bound, errors, conflicts, streams)
