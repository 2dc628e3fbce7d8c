"""The farm's metrics for Prometheus: read from the table on each scrape, never pushed."""

from pnfarm.metrics.collector import FarmCollector, Scrape
from pnfarm.metrics.families import CONTENT_TYPE

__all__ = ["CONTENT_TYPE", "FarmCollector", "Scrape"]
