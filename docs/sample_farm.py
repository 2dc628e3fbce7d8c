"""A farm with a drive on each bus, and a device, for pages that are made of what a farm offers."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.testing import Line

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["sample_line"]

GSDML = Path(__file__).parents[1] / "configs" / "gsdml" / "GSDML-V2.35-Example-Island-20261127.xml"
FARM = f"""
farm: sample
link: {{kind: memory}}
drives:
  - {{name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}}
  - {{name: axis-02, model: akd-ethernetip, ip: 10.77.0.12/24}}
  - {{name: axis-03, model: moog-msd-dp, address: 11}}
devices:
  - name: island-1
    gsdml: {GSDML}
    access_point: DAP 1
    ip: 10.77.0.21/24
    slots: {{1: 16DI}}
    signals: {{part_present: {{at: 1.1.0.3, metrics: true}}}}
"""


@contextmanager
def sample_line() -> Iterator[Line]:
    """The farm, in memory, before anything happened."""
    line = Line.from_text(FARM)
    try:
        yield line
    finally:
        line.close()
