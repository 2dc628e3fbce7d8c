"""A farm of virtual servo drives that a real controller runs.

::

    async with pnfarm.Farm.from_file("line-1.pnfarm.yml") as farm:
        await farm.drive("axis-01").fault("f702")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.farm import Farm

__version__ = "0.1.0"

__all__ = ["AxisProgram", "Farm", "Plc", "__version__"]


def __getattr__(name: str) -> Any:
    # on demand: a farm brings NumPy and the engine along, which `import pnfarm` alone should not cost
    if name == "Farm":
        from pnfarm.farm.farm import Farm  # noqa: PLC0415 - see above

        return Farm
    if name == "Plc":
        from pnfarm.controller.runtime import Plc  # noqa: PLC0415 - see above

        return Plc
    if name == "AxisProgram":
        from pnfarm.controller.axis_program import AxisProgram  # noqa: PLC0415 - see above

        return AxisProgram
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
