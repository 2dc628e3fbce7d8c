"""Random faults out of the catalogue, and what a drive looks like when none is in force."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest
from cip_line import CipLine
from fault_line import FaultLine
from kinds_of import fits

from pnfarm.buses.ethernetip.device.connections import nobody
from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
from pnfarm.buses.profibus.device.device import ProfibusDevice
from pnfarm.buses.profinet.device.modules import modules_view
from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.faults.kind import InjectionKind, ParamSpec
from pnfarm.firmware.axis import AXIS

#: Numbers of a load that a small motor survives: what runs away is another test's.
_LOADS = {"torque": (-1.0, 1.0), "inertia": (0.0, 1e-4), "friction": (0.0, 2.0)}
#: Fields of the axis that faults write.
_OF_FAULTS = tuple(key for key, field in AXIS.fields.items() if field.writer == "fault")
#: A reset ends the faults; the connections come back by themselves, phase by phase of their start-up.  A drive whose
#: address was contested probes it again after up to 13 s.
BACK_SECONDS = 20.0
#: Then the axis programs acknowledge what the faults left, a buffer of eight at a time.
RUNNING_SECONDS = 15.0
#: How each model's line is run.
LINES: dict[str, dict[str, Any]] = {
    "akd-profinet": {"cycle": "16ms"},
    "hiwin-e1": {"cycle": "4ms", "telegram": 3},
    "moog-msd": {"cycle": "4ms"},
}


#: A model of each bus.
MODELS = {"profinet": "akd-profinet", "ethernetip": "akd-ethernetip"}


def model_for(kind: InjectionKind, bus_name: str | None = None) -> str:
    """A model that can have this kind."""
    if kind.family == "liveness":
        return "hiwin-e1"
    return MODELS[bus_name or next(name for name in MODELS if fits(kind, name))]


def every_kind() -> list[Any]:
    """Each kind with a model of each bus that can have it."""
    return [
        pytest.param(kind, model_for(kind, name), id=kind.name if name == "profinet" else f"{kind.name}-{name}")
        for kind in fault_kinds().values()
        for name in MODELS
        if fits(kind, name)
    ]


def empty_line(kind: InjectionKind) -> FaultLine | CipLine:
    """One drive that can have this kind, without a connection."""
    model = model_for(kind)
    if model == MODELS["ethernetip"]:
        return CipLine()
    return FaultLine(model=model, limits="lax", **{**LINES[model], "cycle": "4ms"})


def line_of(model: str, drives: int) -> FaultLine | CipLine:
    """Drives of one model, connected and in operation."""
    line = CipLine(drives) if model == MODELS["ethernetip"] else FaultLine(drives, model=model, **LINES[model])
    line.connect(20.0)
    line.enable(20.0)
    return line


def back(line: FaultLine | CipLine) -> None:
    """Reset, and see every drive exchange data and run again in time."""
    line.clear()
    line.run(0.002)  # the engine lets held frames go in its next step
    assert line.until(lambda: line.plc.all_connected, BACK_SECONDS), line.reasons()
    assert line.until(lambda: line.plc.all_running, RUNNING_SECONDS), line.reasons()


def value_of(rng: Random, kind: InjectionKind, name: str, spec: ParamSpec, faults: list[Any]) -> Any:
    """Some value that a parameter of a kind may have."""
    match spec.type:
        case "yes or no":
            return rng.random() < 0.5
        case "duration":
            return f"{rng.randint(1, 3000)}ms"
        case "word":
            return rng.choice(sorted(spec.words))
        case "octets":
            return rng.randbytes(rng.randint(0, 8)).hex()
        case "mac":
            return "02:" + rng.randbytes(5).hex(":")
        case "fault":
            return rng.choice(faults)
    if kind.name == "load":
        return rng.uniform(*_LOADS[name])
    if spec.words and rng.random() < 0.7:
        return rng.choice(sorted(spec.words))
    low = -1000 if spec.low is None else int(spec.low)
    high = 1000 if spec.high is None else int(spec.high)
    # slots and channels are few: most of a wide range is unused
    return rng.randint(low, min(high, low + 3)) if rng.random() < 0.7 else rng.randint(low, high)


def random_fault(rng: Random, kind: InjectionKind, drive: str, faults: list[Any]) -> dict[str, Any]:
    """The fields of one fault of this kind."""
    fields: dict[str, Any] = {"kind": kind.name, "on": drive}
    params = {
        name: value_of(rng, kind, name, spec, faults)
        for name, spec in kind.params.items()
        if spec.required or rng.random() < 0.4
    }
    if params:
        fields["params"] = params
    if "seed" in kind.takes:
        fields["seed"] = rng.randrange(1 << 30)
    if "probability" in kind.takes and rng.random() < 0.4:
        fields["probability"] = rng.uniform(0.05, 1.0)
    ends = [end for end in ("count", "for", "cycles") if end in kind.takes]
    if ends and rng.random() < 0.5:
        end = rng.choice(ends)
        fields[end] = f"{rng.randint(50, 4000)}ms" if end == "for" else rng.randint(1, 30)
    if kind.directions and rng.random() < 0.5:
        fields["direction"] = rng.choice(kind.directions)
    if rng.random() < 0.3:
        fields["after"] = f"{rng.randint(1, 2000)}ms"
    return fields


def add(line: FaultLine | CipLine, fields: dict[str, Any]) -> bool:
    """Put a fault in force; false where this drive cannot do it."""
    rest = {key: value for key, value in fields.items() if key not in {"kind", "on"}}
    try:
        line.add(fields["kind"], fields["on"], **rest)
    except ConfigError:
        return False
    return True


def storm(line: FaultLine | CipLine, seed: int, count: int, gap: float) -> None:
    """So many faults on random drives, with up to ``gap`` seconds between two."""
    rng = Random(seed)
    kinds = list(fault_kinds().values())
    model = line.farm.axes[0].model
    faults = sorted(fault.number for fault in model.faults.values())
    added = 0
    while added < count:
        drive = rng.choice(line.farm.axes).configured_name
        added += add(line, random_fault(rng, rng.choice(kinds), drive, faults))
        line.run(rng.uniform(0.0, gap))


def left_behind(line: FaultLine | CipLine) -> dict[str, Any]:
    """What faults have left of themselves anywhere; empty when they left nothing."""
    found: dict[str, Any] = {}

    def look(name: str, value: Any) -> None:
        if value:
            found[name] = value

    manager, gate = line.faults, line.farm.link
    look("faults", [fault.id for fault in manager.list()])
    look("active", manager.active())
    look("due", manager.next_deadline())
    for station in line.farm.axes:
        look(f"{station.configured_name} gate", gate.in_force(station.port.index))
        look(f"{station.configured_name} in force", manager.drive(station.configured_name).in_force())
    look("impairment rows", np.flatnonzero(line.farm.columns.impairment["kind"]).tolist())
    look("impaired providers", np.flatnonzero(line.farm.columns.ppm["impairment"]).tolist())
    look("impaired consumers", np.flatnonzero(line.farm.columns.cpm["impairment"]).tolist())
    engine = line.farm.columns.engine[0]
    look("frames held back", (int(engine.held_out), int(engine.held_in)) if engine.held_out or engine.held_in else None)
    for core in getattr(line, "controllers", (line.plc,)):
        for session in getattr(core, "sessions", ()):
            look(f"{session.plan.name} unusable for the controller", dict(getattr(session, "unusable", {})))
    for station, axis in zip(line.farm.axes, line.farm.columns.axis, strict=False):
        name = station.configured_name
        look(f"{name} runs", manager.of_drive(name))
        look(f"{name} axis", {key: float(AXIS.read(axis, key)) for key in _OF_FAULTS if AXIS.read(axis, key)})
        look(f"{name} without power", not station.powered)
        device = station.device
        if isinstance(device, ProfibusDevice):
            continue
        look(f"{name} has another address", station.port.mac != station.station.config.mac)
        if isinstance(device, EthernetIpDevice):
            look(f"{name} refuses", device.connections.refuse is not nobody)
            look(f"{name} is listened to", device.connections.listeners)
            look(f"{name} refuses requests", device.adapter.router.refuse is not None)
            look(f"{name} has another identity", device.identity.product_code != device.kind.identity(0).product_code)
            continue
        look(f"{name} refuses", station.device.cm.refuse_connect is not None)
        look(f"{name} delays ready", station.device.connections.ready_delay is not None)
        look(f"{name} answers late", station.device.rpc.late is not None)
        look(f"{name} diagnosis", list(station.device.cm.diagnosis))
        look(f"{name} refuses records", station.device.kind.records.error is not None)
        look(f"{name} withholds responses", station.device.kind.records.withhold is not None)
        look(f"{name} modules", [m for m in modules_view(station.device) if m["held"] or m["substitute"]])
        awaiting = [s for m in modules_view(station.device) for s in m["submodules"] if s["awaits_parameters"]]
        look(f"{name} awaits parameters", awaiting)
    return found


def kept(line: FaultLine | CipLine) -> dict[str, int]:
    """How many entries each list has that grows with what happens, after a rest."""
    manager = line.faults
    return {
        "runs due": manager.scheduled[0],
        "entries kept for them": manager.scheduled[1],
        "replies kept by drives": sum(len(station.device.rpc._kept) for station in line.farm.axes),
        "calls of drives": sum(len(station.device.client._calls) for station in line.farm.axes),
        "the controller's connections": len(line.plc.life.by_ar),
        "the controller's calls": len(line.plc.life.by_call),
        "drives asked for": len(line.plc._search._asked) + len(line.plc._search._addressed),
        "channel rows": int(line.farm.columns.ppm["active"].sum() + line.farm.columns.cpm["active"].sum()),
    }
