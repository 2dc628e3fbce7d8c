"""A station's part of a state: supply, non-volatile memory, signals, parameters in force and records of its axes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.memory.rows import rows_of, values_of
from pnfarm.farm.state.axis_fields import check_fields
from pnfarm.farm.state.refused import RefusedStateError, mapped
from pnfarm.farm.views.stations import json_value
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station

__all__ = ["check_station", "memory_of", "notes_of", "plain_station"]

_KEYS = ("model", "powered", "controller", "memory", "signals", "axes")
#: S4 and S5: the power stage is on.
_IN_OPERATION = 4
#: Faults have 24 bits.
_FAULTS = 1 << 24
#: Characters of a controller's name or address.
_LONGEST = 100


def plain_station(station: Station) -> dict[str, Any]:
    """All but the records of its axes, as plain JSON."""
    connection = station.device.connection() if station.device.connected else None
    signals = station.signals
    forced = {} if signals is None else {name: json_value(value) for name, value in signals.forced.items()}
    return {
        "model": station.kinds[0],
        "powered": station.powered,
        "controller": None if connection is None else str(connection.ip or connection.controller)[:_LONGEST],
        "memory": {key: json.loads(text) for key, text in rows_of(station.kept) if key},
        "signals": None if signals is None else {**signals.state(), "forced": forced, "names": list(signals.names)},
        "axes": {
            axis.configured_name: {"model": axis.model.name, "parameters": axis.store.in_force()}
            for axis in station.axes
        },
    }


def check_station(station: Station, state: Any) -> None:
    """What :func:`plain_station` gave, with records; raises :class:`RefusedStateError`."""
    name = station.configured_name
    mapped(state, name, _KEYS)
    if state["model"] not in station.kinds:
        raise RefusedStateError(f"it is of another farm file: {name} is another model there")
    if type(state["powered"]) is not bool:
        raise RefusedStateError(f"`powered` of {name} is {shown(state['powered'])}, not true or false")
    controller = state["controller"]
    if controller is not None and not (
        isinstance(controller, str) and len(controller) <= _LONGEST and controller.isprintable()
    ):
        raise RefusedStateError(f"`controller` of {name} is {shown(controller)}, not a name")
    if {*mapped(state["axes"], f"`axes` of {name}")} != {axis.configured_name for axis in station.axes}:
        raise RefusedStateError(f"it is of another farm file: {name} has other axes there")
    for axis in station.axes:
        _check_axis(axis, state["axes"][axis.configured_name])
    try:
        memory = memory_of(station, state)
        station.device.check(memory)
        for axis in station.axes:
            _check_memory(axis, memory)
        _check_signals(station, state["signals"])
    except (ConfigError, EnvironmentError_) as exc:
        raise RefusedStateError(f"{name}: {exc}") from exc


def _check_axis(axis: Axis, state: Any) -> None:
    name = axis.configured_name
    mapped(state, name, ("model", "parameters", "fields"))
    if state["model"] != axis.model.name:
        raise RefusedStateError(f"it is of another farm file: {name} is another model there")
    check_fields(state["fields"], name)
    try:
        axis.store.check_in_force(mapped(state["parameters"], f"`parameters` of {name}"))
    except (ConfigError, ParameterError) as exc:
        raise RefusedStateError(f"{name}: {exc}") from exc


def _check_memory(axis: Axis, memory: Mapping[str, Any]) -> None:
    """What the bus's device does not know of: saved values and faults of any of its axes."""
    if (kept := memory.get(axis.key("drive"))) is not None:
        mapped(kept, f"`{axis.key('drive')}`")
    faults = memory.get(axis.key("faults"), [])
    if not isinstance(faults, list) or not all(type(one) is int and 0 <= one < _FAULTS for one in faults):
        raise RefusedStateError(f"`{axis.key('faults')}` is {shown(faults)}, not a list of faults")


def _check_signals(station: Station, state: Any) -> None:
    signals = station.signals
    if signals is None or state is None:
        if (signals is None) != (state is None):
            raise RefusedStateError("its signals are others")
        return
    mapped(state, "`signals`", ("written", "set", "forced", "names"))
    if state["names"] != list(signals.names):
        raise RefusedStateError("its signals are others: it is of another farm file")
    signals.take_state(state, check=True)


def memory_of(station: Station, state: Mapping[str, Any]) -> dict[str, Any]:
    """The contents of non-volatile memory; raises :class:`RefusedStateError`."""
    name = station.configured_name
    memory = mapped(state["memory"], f"`memory` of {name}")
    if "" in memory:
        raise RefusedStateError(f"`memory` of {name} has a value without a name")
    rows = [(key, json.dumps(value)) for key, value in memory.items()]
    try:
        return values_of(rows, name, EnvironmentError_)
    except EnvironmentError_ as exc:
        raise RefusedStateError(str(exc)) from exc


def notes_of(name: str, state: Mapping[str, Any]) -> list[str]:
    """A sentence for whatever is not as it was."""
    notes = []
    if state["controller"] is not None:
        notes.append(f"{name}: its connection to {state['controller']} is set up again by its controller")
    for axis, its in state["axes"].items():
        if state["powered"] and its["fields"]["drive.state"] >= _IN_OPERATION:
            notes.append(f"{axis}: it was in operation; its power stage is off until its controller switches it on")
    return notes
