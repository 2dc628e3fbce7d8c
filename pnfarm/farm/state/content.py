"""The state of a whole farm: taken, checked as a whole, and put back.

A restore switches every station off and on with the memory that it had, and then writes into the rows what firmware
and plant had there, between two ticks.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from pnfarm.engine.gap import between_ticks
from pnfarm.farm.state.axis_fields import LAYOUT, fields_of, octets_of, put_octets
from pnfarm.farm.state.plant import check_plant, filled, plain_plant
from pnfarm.farm.state.refused import RefusedStateError, mapped
from pnfarm.farm.state.stations import check_station, memory_of, notes_of, plain_station
from pnfarm.faults.effects.supply import SUPPLY
from pnfarm.station.fault_memory import active_of
from pnfarm.vocabulary.quoting import shortened, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.plant.table import PlantCopies

__all__ = ["TakenState", "check_state", "put_state"]

#: Version of the format.
FORMAT = 1
_KEYS = ("pnfarm_state", "layout", "stations", "plant")
#: Axes whose records are copied between the same two ticks.
_TOGETHER = 32


class TakenState:
    """The state as it is now, of one moment, except for axes beyond the first ones.

    ``notes``: a sentence for whatever is not in it.

    All records are copied in the constructor; :meth:`plain` may be called in another thread.
    """

    def __init__(self, core: FarmCore) -> None:
        plant, columns = core.plant, core.columns
        self._saved = time.time()
        #: Of models in Python, and of FMUs.
        self._inside: tuple[Mapping[str, Any], Mapping[str, Any]] = {}, {}
        self.notes: list[str] = []
        if plant is not None:
            python, self.notes = plant.python.states()
            fmus, more = plant.fmus.states(core.now)
            self._inside = python, fmus
            self.notes += more
        self._stations = {station.configured_name: plain_station(station) for station in core.stations}
        self._names = [(axis.station.configured_name, axis.configured_name) for axis in core.axes]
        self._rows: list[Any] = []
        for begin, end in _blocks(len(core.axes)):

            def copied(begin: int = begin, end: int = end) -> tuple[Any, PlantCopies | None]:
                with_plant = None if plant is None or end < len(core.axes) else plant.table.copies()
                return columns.axis[begin:end].copy(), with_plant

            rows, copies = between_ticks(columns, copied)
            self._rows.append(rows)
        self._plant = plant
        self._copied = copies
        self._parts = {} if plant is None else {name: part.signals.state() for name, part in plant.parts.items()}
        if connected := [name for name, state in self._stations.items() if state["controller"] is not None]:
            self.notes.append(f"connections are not saved, those of {shortened(connected)}")

    def plain(self) -> dict[str, Any]:
        """As plain JSON."""
        every = [fields for rows in self._rows for fields in fields_of(rows)]
        for (station, axis), fields in zip(self._names, every, strict=True):
            self._stations[station]["axes"][axis]["fields"] = fields
        plant = None
        if self._plant is not None and self._copied is not None:
            plant = plain_plant(self._plant, self._copied, self._parts, *self._inside)
        return {
            "pnfarm_state": FORMAT, "layout": LAYOUT, "saved": self._saved, "stations": self._stations, "plant": plant,
        }  # fmt: skip


def _blocks(axes: int) -> list[tuple[int, int]]:
    """First and last axis of each block, also of none."""
    return [(begin, min(begin + _TOGETHER, axes)) for begin in range(0, max(axes, 1), _TOGETHER)]


def check_state(core: FarmCore, state: Any) -> dict[str, Any]:
    """A state that can be put into this farm; raises :class:`RefusedStateError` with what is wrong."""
    found = mapped(state, "it")
    if found.get("pnfarm_state") != FORMAT:
        raise RefusedStateError(f"it has format {shown(found.get('pnfarm_state'))}; this pnfarm reads format {FORMAT}")
    if found.get("layout") != LAYOUT:
        raise RefusedStateError("it is of another version of pnfarm, whose drives have other fields")
    mapped({key: one for key, one in found.items() if key != "saved"}, "it", _KEYS)
    stations = mapped(found["stations"], "`stations`")
    names = {station.configured_name for station in core.stations}
    for name in sorted({*stations} ^ names):
        where = "the farm" if name in names else "the state"
        raise RefusedStateError(f"it is of another farm file: station {shown(name)} is only in {where}")
    for station in core.stations:
        check_station(station, stations[station.configured_name])
    check_plant(core.plant, found["plant"])
    return found


def put_state(core: FarmCore, state: Mapping[str, Any], now: int) -> list[str]:
    """Put in what :func:`check_state` accepted; a sentence for whatever is not as it was.

    Raises :class:`ConfigError` for a model in Python that refuses its state, and :class:`EnvironmentError_` for memory
    that cannot be written; nothing is changed then.
    """
    core.service(now)
    _replace(core, state, now)
    notes: list[str] = []
    for station in core.stations:
        its = state["stations"][station.configured_name]
        if station.powered:
            station.power_off(now)
        station.power_on(now)
        for axis in station.axes:
            axis.store.put_in_force(its["axes"][axis.configured_name]["parameters"])
        station.switched_off = not its["powered"]
        supply = core.injections.drive(station.configured_name).find(SUPPLY)
        if station.switched_off or (supply is not None and supply.held_off):
            station.power_off(now)
        if station.signals is not None:
            station.signals.take_state(its["signals"])
        core.settle(station, now)
        notes += notes_of(station.configured_name, its)
    _put_rows(core, state)
    # what the engine reported while the stations were switched
    core.service(now)
    for station in core.stations:
        for axis in station.axes if station.powered else ():
            for number in active_of(axis.handle.axis):
                axis.device.fault_raised(axis.number, number)
        core.settle(station, now)
    return notes if core.plant is None else notes + core.plant.fmus.put_states(state["plant"]["fmus"], core.now)


def _replace(core: FarmCore, state: Mapping[str, Any], now: int) -> None:
    """Memory and models in Python, which may refuse: all of them, or none."""
    before = []
    try:
        for station in core.stations:
            before.append((station, station.kept))
            station.replace_memory(memory_of(station, state["stations"][station.configured_name]))
        if core.plant is not None:
            core.plant.python.put_states(state["plant"]["python"], now)
    except BaseException:
        for station, kept in before:
            # what cannot be written back now is held
            station.kept = kept
            station.save()
        raise


def _put_rows(core: FarmCore, state: Mapping[str, Any]) -> None:
    plant, columns = core.plant, core.columns
    for begin, end in _blocks(len(core.axes)):
        octets = []
        for axis in core.axes[begin:end]:
            its = state["stations"][axis.station.configured_name]["axes"][axis.configured_name]
            octets.append(octets_of(columns.axis[axis.index : axis.index + 1], its["fields"]))

        def write(begin: int = begin, end: int = end, octets: list[Any] = octets) -> None:
            for index, its in enumerate(octets, begin):
                put_octets(columns, index, its)
            if end == len(core.axes) and plant is not None:
                plant.table.put_back(filled(plant, plant.table.copies(), state["plant"]))

        between_ticks(columns, write)
    if plant is not None:
        for name, part in plant.parts.items():
            part.signals.take_state(state["plant"]["parts"][name])
