"""``pnfarm plant``: the models and wires of a farm file's plant, and the built-in models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.cli.farm_file import read
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_json, print_line, print_table
from pnfarm.terminal.settings import Format, FormatOption

if TYPE_CHECKING:
    from pnfarm.behaviours.declaration import Behaviour, Port
    from pnfarm.plant.coupling_kinds import CouplingKind
    from pnfarm.plant.plan import PlantPlan, StationEnd

__all__ = ["plant"]


def plant(
    file: Annotated[
        Path | None, typer.Argument(help="Farm file, *.pnfarm.yml.", metavar="FILE", show_default=False)
    ] = None,
    svg: Annotated[
        Path | None, typer.Option("--svg", help="Draw models and wires into this file.", metavar="FILE")
    ] = None,
    kinds: Annotated[bool, typer.Option("--kinds", help="List the built-in models with ports and parameters.")] = False,
    output: FormatOption = Format.TABLE,
) -> None:
    """List the ports and wires of a farm file's plant, or draw them; or list the built-in models."""
    if kinds:
        _show_kinds(output)
        return
    if file is None:
        raise ConfigError("give a farm file, or --kinds for the built-in models")
    plan = _plan(file)
    if svg is not None:
        from pnfarm.plant.picture import plant_picture

        try:
            svg.write_text(plant_picture(plan), encoding="utf-8")
        except OSError as exc:
            raise ConfigError(f"{svg} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
        print_line(f"{svg}: {len(plan.models)} models, {len(plan.wires)} wires")
        return
    if output is Format.JSON:
        print_json(_as_json(plan))
        return
    print_table(("model", "kind", "step", "port", "direction", "type", "unit"), _port_rows(plan))
    print_line()
    print_table(("wire", "factor", "offset"), _wire_rows(plan))


def _plan(file: Path) -> PlantPlan:
    from pnfarm.farm.farm import model_of
    from pnfarm.farm.file.reading import expand_all
    from pnfarm.farm.plant import plant_of

    config = read(file)
    plan = plant_of(config, expand_all(config), model_of)
    if plan is None:
        raise ConfigError(f"{file} has no plant; add `plant:` with models and wires")
    return plan


def _port_rows(plan: PlantPlan) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, model in plan.models.items():
        step = f"{model.step_ns / 1e6:g} ms"
        for direction, ports in (("input", model.inputs), ("output", model.outputs)):
            rows += [
                (name, model.kinds[0], step, key, direction, port.form, port.unit) for key, (port, _) in ports.items()
            ]
    return rows


def _wire_rows(plan: PlantPlan) -> list[tuple[str, ...]]:
    return [(wire.text.text, f"{wire.scale:g}", f"{wire.offset:g}") for wire in plan.wires]


def _end(plan: PlantPlan, end: int | StationEnd) -> str:
    return plan.name_of(end) if isinstance(end, int) else f"{end.station}.{end.signal}"


def _as_json(plan: PlantPlan) -> dict[str, Any]:
    return {
        "step_seconds": plan.step_ns / 1e9,
        "models": [
            {
                "name": name,
                "kind": model.kinds[0],
                "step_seconds": model.step_ns / 1e9,
                "inputs": [_port(port) for port, _ in model.inputs.values()],
                "outputs": [_port(port) for port, _ in model.outputs.values()],
            }
            for name, model in plan.models.items()
        ],
        "wires": [
            {
                "text": wire.text.text,
                "source": _end(plan, wire.source),
                "target": _end(plan, wire.target),
                "form": wire.form,
                "factor": wire.scale,
                "offset": wire.offset,
            }
            for wire in plan.wires
        ],
    }


def _port(port: Port) -> dict[str, str]:
    return {"name": port.name, "type": port.form, "unit": port.unit, "description": port.doc}


def _kind_as_json(kind: Behaviour | CouplingKind) -> dict[str, Any]:
    inputs, outputs = kind.port_lists
    return {
        "name": kind.name,
        "description": kind.doc,
        "equation": kind.equation,
        "inputs": [_port(port) for port in inputs],
        "outputs": [_port(port) for port in outputs],
        "parameters": [
            {
                "name": one.name,
                "description": one.doc,
                "unit": one.unit,
                "default": one.words[0] if one.words else one.default,
                "words": list(one.words),
            }
            for one in kind.parameters
        ],
    }


def _axes(kind: Behaviour | CouplingKind) -> tuple[str, ...]:
    """The key that names what a coupling joins."""
    shafts = getattr(kind, "shafts", 0)
    return () if not shafts else ("axis",) if shafts == 1 else ("axes",)


def _show_kinds(output: Format) -> None:
    from pnfarm.behaviours.catalogue import BEHAVIOURS
    from pnfarm.plant.coupling_kinds import COUPLINGS

    kinds: list[Behaviour | CouplingKind] = [*BEHAVIOURS.values(), *COUPLINGS.values()]
    found = [_kind_as_json(kind) for kind in kinds]
    if output is Format.JSON:
        print_json(found)
        return
    print_table(
        ("kind", "inputs", "outputs", "parameters"),
        [
            (
                one["name"],
                ", ".join(port["name"] for port in one["inputs"]),
                ", ".join(port["name"] for port in one["outputs"]),
                ", ".join([*_axes(kind), *(parameter["name"] for parameter in one["parameters"])]),
            )
            for kind, one in zip(kinds, found, strict=True)
        ],
    )
    for one in found:
        print_line(f"{one['name']}: {one['description']}  {one['equation']}")
