"""Selects the bus by whose keys the values of a farm file are read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.registry import BUSES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.bus import Bus
    from pnfarm.config.controller import ControllerSection
    from pnfarm.config.drive import DriveGroup
    from pnfarm.config.known import Known
    from pnfarm.config.section import Section

__all__ = ["Choice", "bus_of", "bus_of_controller"]


class Choice:
    """A group is on its model's bus, the controller on that of the first group whose bus has one.

    Where that gives none (an unknown model, a file without drives), it is the bus that knows most of the keys, the
    first of several with the same number.
    """

    def __init__(self, values: Any, known: Known) -> None:
        """``values``: the whole file, as it was written."""
        groups = values.get("drives") if isinstance(values, dict) else None
        self._groups = groups if isinstance(groups, list) else []
        self._known = known

    def group(self, value: Any) -> Bus:
        """The bus of a group, as it was written."""
        return self._of_model(value) or _knows_most(value, {name: bus.farm_file.drives for name, bus in BUSES.items()})

    def controller(self, value: Any) -> Bus:
        """The bus of the controller, as it was written."""
        having = {name: section for name, bus in BUSES.items() if (section := bus.farm_file.controller) is not None}
        buses = (self._of_model(group) for group in self._groups)
        first = next((bus for bus in buses if bus is not None and bus.name in having), None)
        return first or _knows_most(value, having)

    def _of_model(self, group: Any) -> Bus | None:
        model = group.get("model") if isinstance(group, dict) else None
        facts = self._known.model(model) if isinstance(model, str) else None
        return BUSES.get(facts.bus) if facts is not None else None


def _knows_most(value: Any, sections: Mapping[str, type[Section]]) -> Bus:
    given = set(value) if isinstance(value, dict) else set()
    return BUSES[max(sections, key=lambda name: len(given.intersection(sections[name].listed_keys())))]


def bus_of(group: DriveGroup) -> Bus:
    """The bus by whose keys a group was read."""
    return next(bus for bus in BUSES.values() if isinstance(group, bus.farm_file.drives))


def bus_of_controller(section: ControllerSection) -> Bus:
    """The bus by whose keys the controller was read."""
    return next(
        bus for bus in BUSES.values() if (own := bus.farm_file.controller) is not None and isinstance(section, own)
    )
