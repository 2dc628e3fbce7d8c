"""The plant as plain JSON values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.stations import json_value
from pnfarm.plant.plan import StationEnd

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore
    from pnfarm.plant.plant import Plant

__all__ = ["plant_snapshot"]


def plant_snapshot(core: FarmCore) -> dict[str, Any]:
    """Models with the values of their ports, and wires; no models of a farm without a plant."""
    plant = core.plant
    if plant is None:
        return {"step_seconds": None, "steps": 0, "steps_left_out": 0, "models": [], "wires": []}
    return {
        "step_seconds": plant.plan.step_ns / 1e9,
        "steps": plant.steps,
        "steps_left_out": int(core.columns.engine[0].plant_late),
        "models": _models(plant),
        "wires": [
            {"text": wire.text.text, "source": _end(plant, wire.source), "target": _end(plant, wire.target)}
            for wire in plant.plan.wires
        ],
    }


def _models(plant: Plant) -> list[dict[str, Any]]:
    users = {**plant.python.snapshot(), **plant.fmus.snapshot()}
    found = []
    for name, part in plant.parts.items():
        planned = plant.plan.models[name]
        ports = [
            {
                "name": signal.name,
                "direction": signal.direction,
                "type": "bit" if signal.type.kind == "bool" else "number",
                "unit": signal.unit,
                "value": json_value(value),
                "owner": part.signals.owner(signal.name),
            }
            for signal, value, _ in part.signals.readings()
        ]
        running = users.get(name, {"missed_steps": 0, "longest_seconds": None, "failure": ""})
        found.append(
            {
                "name": name,
                "kind": planned.kinds[0],
                "step_seconds": planned.step_ns / 1e9,
                "missed_steps": running["missed_steps"],
                "longest_seconds": running["longest_seconds"],
                "failure": running["failure"],
                "ports": ports,
            }
        )
    return found


def _end(plant: Plant, end: int | StationEnd) -> str:
    return f"{end.station}.{end.signal}" if isinstance(end, StationEnd) else plant.plan.name_of(end)
