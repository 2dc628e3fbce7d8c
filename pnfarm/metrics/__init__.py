"""The farm's metrics for Prometheus: read from the table when they are asked for, never pushed."""

from pnfarm.metrics.collector import FarmCollector, Scrape
from pnfarm.metrics.families import CONTENT_TYPE

__all__ = ["CONTENT_TYPE", "FarmCollector", "Scrape"]
