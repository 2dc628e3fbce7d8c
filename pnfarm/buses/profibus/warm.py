"""What of this bus is compiled; see :mod:`pnfarm.engine.warm`."""

from __future__ import annotations

from pnfarm.buses.profibus.device.fast_path import FastPath
from pnfarm.table.image import IMAGE

__all__ = ["warm"]


def warm() -> None:
    """Compile it, or load it from the cache."""
    FastPath(1, IMAGE.allocate(1))
