"""A farm with a drive on each bus, for pages that are made of what a farm offers."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from pnfarm.testing import Line

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["sample_line"]

FARM = """
farm: sample
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: axis-02, model: akd-ethernetip, ip: 10.77.0.12/24}
  - {name: axis-03, model: moog-msd-dp, address: 11}
"""


@contextmanager
def sample_line() -> Iterator[Line]:
    """The farm, in memory, before anything happened."""
    line = Line.from_text(FARM)
    try:
        yield line
    finally:
        line.close()
