"""The farm file that ``plc --gsdml`` makes of its options: the built-in controller and one device."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["one_device"]

#: The file name in error messages.
ORIGIN = Path("options")


def _places(modules: Sequence[str]) -> dict[str, str | None]:
    """``SLOT=ID`` options; an ID left empty leaves the slot empty."""
    places: dict[str, str | None] = {}
    for option in modules:
        slot, equals, target = option.partition("=")
        if not slot or not equals:
            raise typer.BadParameter(f"{option!r} is not like 1=MODULE", param_hint="--module")
        if slot in places:
            raise typer.BadParameter(f"slot {slot} is given twice", param_hint="--module")
        places[slot] = target or None
    return places


def one_device(
    gsdml: Path,
    *,
    device: str | None,
    ip: str | None,
    interface: str | None,
    dap: str | None,
    modules: Sequence[str],
    cycle: str | None,
    watchdog_factor: int | None = None,
) -> FarmConfig:
    """The farm file, checked like any other.  Raises the framework's usage error, or :class:`FarmFileError`."""
    from pnfarm.farm.file.reading import parse_farm

    for name, value in (("--device", device), ("--ip", ip), ("--interface", interface)):
        if value is None:
            raise typer.BadParameter("is required with --gsdml", param_hint=name)
    own: dict[str, Any] = {"name": device, "gsdml": str(gsdml), "ip": ip, "modules": _places(modules)}
    own |= {key: value for key, value in (("dap", dap), ("cycle", cycle)) if value is not None}
    section: dict[str, Any] = {"interface": interface}
    if watchdog_factor is not None:
        section["watchdog_factor"] = watchdog_factor
    text = json.dumps({"controller": section | {"devices": [own]}}, indent=1)
    return parse_farm(text, ORIGIN)
