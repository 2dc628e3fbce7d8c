"""Stations, devices and their signals, as plain JSON values for the API, the command line and Python code."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import fault_label
from pnfarm.farm.views.snapshot import NO_AR, connection_snapshot
from pnfarm.station.signals import find_signal, signal_names
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.station.axis import Axis
    from pnfarm.station.plain_signals import NamedSignals
    from pnfarm.station.station import Station
    from pnfarm.wire.value_types import Value

__all__ = [
    "device_row", "device_snapshot", "drive_signals", "json_value", "signal_states", "signals_snapshot",
    "station_snapshot",
]  # fmt: skip


def json_value(value: Value) -> bool | int | float | str:
    """As JSON has it: octets in hexadecimal, numbers that are not finite as text."""
    match value:
        case bytes():
            return value.hex(" ")
        case float() if not math.isfinite(value):
            return str(value)
        case _:
            return value


def station_snapshot(station: Station, now: int) -> dict[str, Any]:
    """One station, drive or device."""
    seen = station.device.view(now)
    connection = station.device.connection()
    return {
        "name": station.configured_name,
        "station_name": seen.get("station_name", station.device.name),
        "kind": "drive" if station.axes else "device",
        "bus": station.bus,
        "model": station.axes[0].model.name if station.axes else None,
        "models": list(station.kinds),
        "description": None if station.description is None else station.description.title,
        "axes": [axis.configured_name for axis in station.axes],
        "mac": format_mac(station.port.mac),
        "ip": seen.get("ip"),
        "station_address": seen.get("station_address"),
        "powered": station.powered,
        "connected": bool(station.powered and connection is not None and connection.exchanging),
    }


def device_row(station: Station, now: int) -> dict[str, Any]:
    """A device in a list."""
    signals = station.signals
    counts = Counter(() if signals is None else (signals.signal(name).direction for name in signals.names))
    return {
        **station_snapshot(station, now),
        "connection": _connection(station, now),
        "inputs": counts["input"],
        "outputs": counts["output"],
    }


def device_snapshot(station: Station, now: int) -> dict[str, Any]:
    """A device in full."""
    described = station.description
    return {
        **device_row(station, now),
        "identity": {} if described is None else dict(described.identity),
        "access_point": "" if described is None else described.access_point,
        "modules": [] if described is None else [asdict(module) for module in described.modules],
        "details": station.device.details(),
        "signals": [] if station.signals is None else signals_snapshot(station.signals),
    }


def _connection(station: Station, now: int) -> dict[str, Any]:
    found = station.device.connection() if station.powered else None
    state = found.state if found is not None and found.state else NO_AR
    return {"state": state, **connection_snapshot(found, now)}


def drive_signals(axis: Axis) -> Iterator[dict[str, Any]]:
    """The signals of a drive that conditions name, but for its parameters, as they are now."""
    for name in signal_names(axis.model):
        signal = find_signal(axis.model, name)
        assert signal is not None
        value = json_value(signal.now(axis))
        yield {
            "name": name,
            "type": signal.form,
            "unit": signal.unit,
            "value": value,
            "shown": _shown(signal.form, value),
            "doc": signal.doc,
        }


def _shown(form: str, value: bool | float | str) -> str:
    """As a condition has it."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() if form == "word":
            return f"0x{value:04X}"
        case int() if form == "fault" and value:
            return fault_label(value)
        case float():
            return f"{value:.6g}"
        case _:
            return str(value)


def signals_snapshot(signals: NamedSignals) -> list[dict[str, Any]]:
    """Every signal; the values of one direction are of one time."""
    return [
        {
            "name": signal.name,
            "direction": signal.direction,
            "type": signal.type.name,
            "unit": signal.unit,
            "scale": signal.scale,
            "place": signal.place,
            **state,
        }
        for signal, state in signal_states(signals)
    ]


def signal_states(signals: NamedSignals) -> list[tuple[Any, dict[str, Any]]]:
    """Every signal (:class:`pnfarm.signals.signal.Signal`) with what moves of it."""
    forced = signals.forced
    return [
        (
            signal,
            {
                "name": signal.name,
                "value": json_value(value),
                "shown": signal.show(value),
                "good": good,
                "owner": signals.owner(signal.name),
                "forced": json_value(forced[signal.name]) if signal.name in forced else None,
            },
        )
        for signal, value, good in signals.readings()
    ]
