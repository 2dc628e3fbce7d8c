"""Signals of devices in conditions: ``island-1.part_present``, and of the device itself ``part_present`` as well.

The name of a signal has no dot, so that all before the last dot is the station's.  Beside its signals a device has
``connected`` and ``powered``, unless it has signals of these names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, TypeAlias

from pnfarm.signals.layers import EVERY
from pnfarm.station.signals import WORDS
from pnfarm.vocabulary.conditions import names_in
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Mapping, Sequence

    from pnfarm.signals.owner import SignalOwner
    from pnfarm.signals.signal import Signal
    from pnfarm.vocabulary.conditions import Name, Tree, Value

__all__ = [
    "FACTS",
    "DeviceFact",
    "DeviceSignal",
    "KnownDevices",
    "LiveDevices",
    "device_of",
    "find_in",
    "note_forces",
    "releases",
    "split_name",
    "stations_in",
]

#: Devices by name: the signals that each has, and their values.
KnownDevices: TypeAlias = "Mapping[str, Mapping[str, Signal]]"
LiveDevices: TypeAlias = "Mapping[str, SignalOwner]"
#: What any device has.
FACTS: Mapping[str, Callable[[SignalOwner], bool]] = {
    "connected": lambda station: station.powered and station.device.connected,
    "powered": lambda station: station.powered,
}


def split_name(name: str) -> tuple[str, str]:
    """Station and signal of ``STATION.SIGNAL``; the station is empty where there is no dot."""
    station, _, signal = name.rpartition(".")
    return station, signal


def releases(names: Sequence[str], devices: Container[str]) -> dict[str, dict[str, None]]:
    """``STATION.SIGNAL`` and ``STATION``, by station, as :meth:`.StationSignals.force` releases them."""
    found: dict[str, dict[str, None]] = {}
    for name in names:
        station, signal = (name, EVERY) if name in devices or "." not in name else split_name(name)
        found.setdefault(station, {})[signal] = None
    return found


def note_forces(forced: dict[str, set[str]], station: str, values: Mapping[str, object]) -> None:
    """Note what a request forces, and what it releases; ``forced``: signals by station."""
    noted = forced.setdefault(station, set())
    if EVERY in values:
        noted.clear()
    noted |= {name for name, value in values.items() if value is not None}
    noted -= {name for name, value in values.items() if value is None}


def device_of(name: Name, devices: Container[str] | None) -> str:
    """The device whose signal a name in a condition is; empty for another name.

    ``devices`` None: not known; then a name with a dot is such a signal, unless it begins with a word of a drive.
    """
    station, signal = split_name(name.name)
    if (
        name.parameter
        or not station
        or (station in WORDS or signal.isdecimal() if devices is None else station not in devices)
    ):
        return ""
    return station


def stations_in(tree: Tree, devices: Container[str] | None) -> list[str]:
    """The devices whose signals a condition names; none if it has any other name."""
    found = [device_of(name, devices) for name in names_in(tree)]
    return list(dict.fromkeys(found)) if all(found) else []


def find_in(devices: KnownDevices, station: str, name: str) -> DeviceSignal | DeviceFact | None:
    """A signal or a fact of a device that is known; None if it has none of this name."""
    signal = devices[station].get(name)
    if signal is not None:
        return DeviceSignal(station, signal)
    return DeviceFact(station, name) if name in FACTS else None


@dataclass(frozen=True, slots=True)
class DeviceFact:
    """Whether a device is connected, or powered."""

    station: str
    fact: str
    form: ClassVar = "bit"
    unit: ClassVar = ""

    @property
    def name(self) -> str:
        return f"{self.station}.{self.fact}"

    def read(self, devices: LiveDevices) -> bool:
        """Whether it is so now."""
        return FACTS[self.fact](devices[self.station])


@dataclass(frozen=True, slots=True)
class DeviceSignal:
    """A signal of a device as conditions compare it: octets as the text that shows them."""

    station: str
    signal: Signal

    @property
    def name(self) -> str:
        return f"{self.station}.{self.signal.name}"

    @property
    def form(self) -> str:
        """As of :class:`pnfarm.station.signals.DriveSignal`."""
        kind = self.signal.type
        return "bit" if kind.kind == "bool" else "number" if kind.is_number else "text"

    @property
    def unit(self) -> str:
        return self.signal.unit

    def read(self, devices: LiveDevices) -> Value:
        """The present value."""
        signals = devices[self.station].signals
        assert signals is not None
        value = signals.get(self.signal.name)
        return self.signal.show(value) if isinstance(value, bytes) else value

    def text(self, text: str) -> str:
        """A text that it is compared with, as :meth:`read` gives it; :class:`Problem` for one that it never is."""
        return self.signal.show(self.signal.taken(text))

    def number(self, value: float, *, exactly: bool) -> float:
        """A number that it is compared with: the value that its steps have for it.

        ``exactly``: raises :class:`Problem` for a number between its steps, or one that it cannot hold.
        """
        try:
            near = float(self.signal.taken(value))
        except Problem:
            if exactly:
                raise
            return value
        if self.signal.type.kind == "float" or math.isclose(
            near, value, rel_tol=1e-9, abs_tol=1e-9 * abs(self.signal.scale)
        ):
            return near
        if exactly:
            raise Problem(
                f"is never {shown(value)}, which is between two of its steps", f"such as {self.signal.show(near)}"
            )
        return value
