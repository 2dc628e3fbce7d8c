"""A farm of virtual servo drives that a real controller runs.

::

    async with pnfarm.Farm.from_file("line-1.pnfarm.yml") as farm:
        await farm.drive("axis-01").fault("f702")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pnfarm.version import __version__

if TYPE_CHECKING:
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.wait import NotInTime
    from pnfarm.library import Farm

__all__ = ["AxisProgram", "Farm", "NotInTime", "Plc", "__version__"]


#: Where the names are that are imported on demand: a farm brings NumPy and the engine along, which `import pnfarm`
#: alone should not cost.
_PLACES = {
    "AxisProgram": "pnfarm.controller.axis_program",
    "Farm": "pnfarm.library",
    "NotInTime": "pnfarm.farm.wait",
    "Plc": "pnfarm.controller.runtime",
}


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
