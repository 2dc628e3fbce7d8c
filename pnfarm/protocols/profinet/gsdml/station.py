"""A station as a GSDML file and a choice of modules make it: what is plugged where, with data, records and limits.

Modules and submodules that the file fixes are always plugged; those that it puts into a new project are, unless their
place is given another one, or None for none.  A controller's plan (`planning`) and a virtual device are both made
of a :class:`PluggedStation`.

Input and output are the controller's: inputs go to it.  Octets of data items count from the submodule's first one of
that direction.  Bits count from an item's least significant one, values being big-endian; in an octet string from
the least significant bit of its first octet (assumed: makers describe single octets).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, Literal, TypeVar

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.choosing import listed, matching, name_of, words
from pnfarm.protocols.profinet.gsdml.document import NO_NUMBERS, Dap, InterfaceSubmodule, SubmoduleItem
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from pnfarm.protocols.profinet.gsdml.choosing import Item
    from pnfarm.protocols.profinet.gsdml.document import (
        DataItems,
        Gsdml,
        Info,
        ItemRef,
        ModuleItem,
        PortSubmodule,
        Relations,
    )
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord
    from pnfarm.protocols.profinet.gsdml.values import Numbers

    #: How a user names an access point, a module or a submodule.
    Wanted = str | int

__all__ = ["Place", "PlugError", "PluggedItem", "PluggedModule", "PluggedStation", "PluggedSubmodule", "plug_station"]

#: Modules of a device and submodules of a module; real ones have some hundred.
_MOST = 4096
#: Octets of a device's records; real ones have some thousand.
_MOST_OCTETS = 1 << 22
#: Types whose values have an order of octets of their own.
_STRINGS = ("OctetString", "OctetString_S", "VisibleString", "UnicodeString8")

#: Slot and subslot.
Place = tuple[int, int]

T = TypeVar("T", bound="Item")


class PlugError(ConfigError):
    """A choice that the file does not allow, or a file that contradicts itself.

    ``slot`` and ``subslot`` say where, None where it is not about one; ``line`` is that of the file, 0 for none.
    """

    def __init__(self, reason: str, *, slot: int | None = None, subslot: int | None = None, line: int = 0) -> None:
        super().__init__(f"line {line}: {reason}" if line else reason)
        self.reason = reason
        self.slot = slot
        self.subslot = subslot
        self.line = line


@dataclass(frozen=True, slots=True)
class PluggedItem:
    """One datum: ``octet`` is its first one in the submodule's inputs or outputs; ``bits`` are those that the file
    names: (octet, bit, name)."""

    name: str
    data_type: str
    octet: int
    octets: int
    use_as_bits: bool = False
    bits: tuple[tuple[int, int, str], ...] = ()

    @property
    def all_bits(self) -> tuple[tuple[int, int, str], ...]:
        """Each of its bits, named by its number."""
        return tuple((*self.bit_place(number), f"{self.name} {number}") for number in range(8 * self.octets))

    def bit_place(self, number: int) -> tuple[int, int]:
        """(octet, bit) of a BitOffset."""
        inside = number // 8
        return self.octet + (inside if self.data_type in _STRINGS else self.octets - 1 - inside), number % 8


@dataclass(frozen=True, slots=True)
class PluggedSubmodule:
    """A submodule in its place.

    ``records`` have the F parameters among them, which ``f_parameters`` is; ``writeable_im`` are the numbers of the
    I&M records that can be written (I&M0 is always read only).
    """

    slot: int
    subslot: int
    module_ident: int
    ident: int
    id: str = ""
    name: str = ""
    kind: Literal["virtual", "pluggable", "interface", "port"] = "virtual"
    api: int = 0
    inputs: tuple[PluggedItem, ...] = ()
    outputs: tuple[PluggedItem, ...] = ()
    iops_length: int = 1
    iocs_length: int = 1
    profisafe: bool = False
    f_parameters: ParameterRecord | None = None
    records: tuple[ParameterRecord, ...] = ()
    writeable_im: Numbers = NO_NUMBERS
    line: int = 0

    @property
    def input_octets(self) -> int:
        return sum(item.octets for item in self.inputs)

    @property
    def output_octets(self) -> int:
        return sum(item.octets for item in self.outputs)

    @property
    def has_data(self) -> bool:
        return bool(self.inputs or self.outputs)

    def record(self, index: int) -> ParameterRecord | None:
        return next((record for record in self.records if record.index == index), None)


@dataclass(frozen=True, slots=True)
class PluggedModule:
    """A module in its slot, the access point's among them; ``submodules`` as the file lists them: virtual ones,
    interfaces, ports, pluggable ones."""

    slot: int
    ident: int
    id: str
    info: Info
    submodules: tuple[PluggedSubmodule, ...] = ()

    def submodule(self, subslot: int) -> PluggedSubmodule | None:
        return next((one for one in self.submodules if one.subslot == subslot), None)


@dataclass(frozen=True, slots=True)
class PluggedStation:
    """A device with its modules: ``modules`` has the access point's first, the others by slot."""

    gsdml: Gsdml
    dap: Dap
    modules: tuple[PluggedModule, ...]

    @property
    def submodules(self) -> tuple[PluggedSubmodule, ...]:
        return tuple(submodule for module in self.modules for submodule in module.submodules)

    def module(self, slot: int) -> PluggedModule | None:
        return next((module for module in self.modules if module.slot == slot), None)

    def submodule(self, slot: int, subslot: int) -> PluggedSubmodule | None:
        module = self.module(slot)
        return module.submodule(subslot) if module else None

    # identity

    @property
    def vendor_id(self) -> int:
        return self.gsdml.vendor_id

    @property
    def device_id(self) -> int:
        return self.gsdml.device_id

    @property
    def vendor_name(self) -> str:
        return self.dap.info.vendor_name or self.gsdml.vendor_name

    @property
    def name(self) -> str:
        """The access point's, else the product family's."""
        return self.dap.info.name or self.gsdml.product_family or self.dap.id

    @property
    def order_number(self) -> str:
        return self.dap.info.order_number

    @property
    def hardware_release(self) -> str:
        return self.dap.info.hardware_release

    @property
    def software_release(self) -> str:
        return self.dap.info.software_release

    @property
    def product_family(self) -> str:
        return self.gsdml.product_family

    # connections

    @property
    def relations(self) -> Relations:
        """Start-up modes, NumberOfAR, send clocks and reduction ratios."""
        return self.dap.relations

    @property
    def number_of_ars(self) -> int:
        return self.relations.number_of_ars

    @property
    def min_device_interval(self) -> int:
        """In 31.25 us."""
        return self.dap.min_device_interval

    @property
    def send_clocks(self) -> Numbers:
        """In 31.25 us."""
        return self.relations.send_clocks

    @property
    def reduction_ratios(self) -> Numbers:
        return self.relations.ratios

    @property
    def dcp_hello(self) -> bool:
        return any(interface.dcp_hello for interface in self.dap.interfaces)

    # lengths

    @property
    def input_octets(self) -> int:
        """Of the input data with their status, as IOConfigData counts them: submodules without data do not count
        (after files that Siemens' tool generates)."""
        return _counted((one.input_octets, one.output_octets, one) for one in self.submodules)

    @property
    def output_octets(self) -> int:
        """The same of the output data."""
        return _counted((one.output_octets, one.input_octets, one) for one in self.submodules)


def _counted(submodules: Iterable[tuple[int, int, PluggedSubmodule]]) -> int:
    """Of one direction: octets there, octets in the other direction, submodule."""
    return sum(
        (octets + one.iops_length if octets else 0) + (one.iocs_length if others else 0)
        for octets, others, one in submodules
    )


def _choose_dap(gsdml: Gsdml, wanted: Wanted | None) -> Dap:
    if wanted is None:
        if len(gsdml.daps) != 1:
            raise PlugError(f"the file describes several access points, choose one of {listed(gsdml.daps)}")
        return gsdml.daps[0]
    found = matching(wanted, gsdml.daps, gsdml.languages)
    if not found:
        raise PlugError(
            f"the file has no access point {wanted!r}, it has {listed(gsdml.daps)}" + _near(wanted, gsdml.daps, gsdml)
        )
    if len(found) > 1:
        raise PlugError(f"several access points are called {wanted!r}, choose one of {listed(found)} by its ID")
    return found[0]


def _near(wanted: Wanted, items: Sequence[Item], gsdml: Gsdml) -> str:
    known = [word for item in items for word in words(item, gsdml.languages) if word]
    return did_you_mean(str(wanted), known)


class _Contents(Generic[T]):
    """Places (slots, or subslots of one slot) and what they take."""

    def __init__(
        self,
        gsdml: Gsdml,
        refs: Sequence[ItemRef],
        physical: Numbers,
        known: Mapping[str, T],
        what: str,
        slot: int | None = None,
    ) -> None:
        self._gsdml = gsdml
        self._refs = refs
        self._physical = physical
        self._known = known
        self._what = what
        #: That of the subslots; None where the places are slots.
        self._slot = slot

    def filled(self, chosen: Mapping[int, Wanted | None]) -> dict[int, T]:
        """What is fixed, what a new project has, and what was chosen, by place."""
        used: dict[int, str] = {}
        fixed: dict[int, str] = {}
        placed = 0
        for ref in self._refs:
            placed += len(ref.used) + len(ref.fixed)
            if placed > _MOST:
                kind = "subslots" if self._slot is not None else "slots"
                raise PlugError(
                    f"{ref.target} and those before it are fixed in {placed} {kind}, at most {_MOST} can be planned",
                    slot=self._slot,
                    line=ref.line,
                )
            used |= dict.fromkeys(ref.used, ref.target)
            fixed |= dict.fromkeys(ref.fixed, ref.target)
        filled = {place: self._described(place, target) for place, target in (used | fixed).items()}
        for place, wanted in chosen.items():
            if wanted is None:
                if place in fixed:
                    raise self._error(place, f"cannot be empty, {fixed[place]} is fixed there")
                filled.pop(place, None)
            else:
                filled[place] = self._chosen(place, wanted, fixed.get(place))
        return dict(sorted(filled.items()))

    def _chosen(self, place: int, wanted: Wanted, fixed: str | None) -> T:
        reachable = not self._physical.ranges or place in self._physical
        able = [ref.target for ref in self._refs if reachable and ref.takes(place)]
        takes = [self._described(place, target) for target in dict.fromkeys(able)]
        found = matching(wanted, takes, self._gsdml.languages)
        if not found:
            raise self._error(
                place,
                f"takes no {self._what} {wanted!r}, it takes {listed(takes) or 'none at all'}" + self._hint(wanted),
            )
        if fixed is not None:
            found = tuple(item for item in found if item.id == fixed)
            if not found:
                raise self._error(place, f"takes no {self._what} {wanted!r}, {fixed} is fixed there")
        if len(found) > 1:
            raise self._error(
                place, f"takes several {self._what}s called {wanted!r}, choose one of {listed(found)} by its ID"
            )
        return found[0]

    def _hint(self, wanted: Wanted) -> str:
        """Where something of that name can be plugged, else what has a similar name."""
        here = {ref.target: self._known[ref.target] for ref in self._refs if ref.target in self._known}
        found = matching(wanted, list(here.values()), self._gsdml.languages)
        if found:
            ref = next(ref for ref in self._refs if ref.target == found[0].id)
            places = " ".join(one.emit() for one in (ref.allowed, ref.used, ref.fixed) if one.ranges)
            kind = "subslots" if self._slot is not None else "slots"
            return f"; {found[0].id} goes into {kind} {places}" if places else ""
        if matching(wanted, list(self._known.values()), self._gsdml.languages):
            if self._slot is not None:
                return "; another module takes it"
            others = [
                dap
                for dap in self._gsdml.daps
                if matching(
                    wanted,
                    [self._known[ref.target] for ref in dap.modules if ref.target in self._known],
                    self._gsdml.languages,
                )
            ]
            return f"; it is for access point {listed(others)}" if others else "; no access point takes it"
        return _near(wanted, list(here.values()), self._gsdml)

    def _described(self, place: int, target: str) -> T:
        item = self._known.get(target)
        if item is None:
            where = f"slot {place if self._slot is None else self._slot}"
            raise PlugError(f"the file names {self._what} {target!r} for {where} and does not describe it")
        return item

    def _error(self, place: int, reason: str) -> PlugError:
        if self._slot is None:
            return PlugError(f"slot {place} {reason}", slot=place)
        return PlugError(f"slot {self._slot}, subslot {place} {reason}", slot=self._slot, subslot=place)


def _items(data: DataItems | None) -> tuple[PluggedItem, ...]:
    """Data items in their places."""
    found = []
    octet = 0
    for item in data.items if data else ():
        bare = PluggedItem(item.name, item.data_type, octet, item.octets, item.use_as_bits)
        inside = [(number, name) for number, name in item.bits if number < 8 * item.octets]
        found.append(replace(bare, bits=tuple((*bare.bit_place(number), name) for number, name in inside)))
        octet += item.octets
    return tuple(found)


class _Plugger:
    def __init__(self, gsdml: Gsdml) -> None:
        self._gsdml = gsdml
        pluggable: tuple[SubmoduleItem | PortSubmodule, ...] = (*gsdml.submodules, *gsdml.pluggable_ports)
        self._pluggable = {one.id: one for one in pluggable}
        self._count = 0
        self._octets = 0

    def plug(self, slot: int, holder: Dap | ModuleItem, chosen: Mapping[int, Wanted | None]) -> PluggedModule:
        """Everything of one slot."""
        found: dict[int, PluggedSubmodule] = {}
        for one in self._of(slot, holder, chosen):
            if one.subslot in found:
                raise PlugError(
                    f"slot {slot}, subslot 0x{one.subslot:04X} is taken twice, one submodule fits there",
                    slot=slot,
                    subslot=one.subslot,
                    line=one.line,
                )
            self._count += 1
            if self._count > _MOST:
                raise PlugError(f"slot {slot} has more submodules than fit, at most {_MOST} can be planned", slot=slot)
            self._octets += sum(record.length for record in one.records)
            if self._octets > _MOST_OCTETS:
                raise PlugError(
                    f"slot {slot} has more records than can be written, at most {_MOST_OCTETS} octets", slot=slot
                )
            found[one.subslot] = one
        return PluggedModule(slot, holder.ident, holder.id, holder.info, tuple(found.values()))

    def _of(
        self, slot: int, holder: Dap | ModuleItem, chosen: Mapping[int, Wanted | None]
    ) -> Iterator[PluggedSubmodule]:
        for virtual in holder.submodules:
            bare = self._with_data(slot, holder.ident, virtual)
            for subslot in virtual.fixed:
                yield replace(bare, subslot=subslot)
        if isinstance(holder, Dap):
            for interface in holder.interfaces:
                yield _system(slot, interface.subslot, holder.ident, interface)
        for port in holder.ports:
            yield _system(slot, port.subslot, holder.ident, port)
        contents: _Contents[SubmoduleItem | PortSubmodule] = _Contents(
            self._gsdml, holder.useable, holder.physical_subslots, self._pluggable, "submodule", slot
        )
        for subslot, item in contents.filled(chosen).items():
            if isinstance(item, SubmoduleItem):
                yield replace(self._with_data(slot, holder.ident, item), subslot=subslot, kind="pluggable")
            else:
                yield _system(slot, subslot, holder.ident, item)

    def _with_data(self, slot: int, module_ident: int, item: SubmoduleItem) -> PluggedSubmodule:
        safe = item.f_parameters
        return PluggedSubmodule(
            slot=slot,
            subslot=0,
            module_ident=module_ident,
            ident=item.ident,
            id=item.id,
            name=name_of(item),
            api=item.api,
            inputs=_items(item.inputs),
            outputs=_items(item.outputs),
            iops_length=item.iops_length,
            iocs_length=item.iocs_length,
            profisafe=item.profisafe,
            f_parameters=safe,
            records=item.records if safe is None else (*item.records, safe),
            writeable_im=item.writeable_im,
            line=item.line,
        )


def _system(slot: int, subslot: int, module_ident: int, item: InterfaceSubmodule | PortSubmodule) -> PluggedSubmodule:
    return PluggedSubmodule(
        slot=slot,
        subslot=subslot,
        module_ident=module_ident,
        ident=item.ident,
        id=item.id,
        name=item.name,
        kind="interface" if isinstance(item, InterfaceSubmodule) else "port",
        records=item.records,
        writeable_im=item.writeable_im,
    )


def _check_lengths(station: PluggedStation) -> None:
    found, limits = (station.input_octets, station.output_octets), station.dap
    both = sum(found)
    for what, octets, most in (
        ("inputs", found[0], limits.max_input),
        ("outputs", found[1], limits.max_output),
        ("inputs and outputs", both, limits.max_data),
    ):
        if most and octets > most:
            raise PlugError(
                f"the modules have {octets} octets of {what} with their status, "
                f"access point {limits.id} takes up to {most}"
            )


def plug_station(
    gsdml: Gsdml,
    *,
    access_point: Wanted | None = None,
    modules: Mapping[int, Wanted | None] | None = None,
    submodules: Mapping[Place, Wanted | None] | None = None,
) -> PluggedStation:
    """Plug a device together.

    ``access_point`` may be left out where the file has one.  ``modules`` gives slots their modules, ``submodules``
    places (slot, subslot) theirs: by ID, order number, name in any language of the file, or ident (an integer, or such
    as ``0x0000002A``); None leaves a place empty that a new project would fill.  Raises :class:`PlugError` for what
    the file does not allow.
    """
    dap = _choose_dap(gsdml, access_point)
    chosen: dict[int, dict[int, Wanted | None]] = {}
    for (slot, subslot), wanted in (submodules or {}).items():
        chosen.setdefault(slot, {})[subslot] = wanted
    if dap.slot in (modules or {}):
        raise PlugError(f"slot {dap.slot} is the access point's, modules are in other slots", slot=dap.slot)
    plugger = _Plugger(gsdml)
    plugged = [plugger.plug(dap.slot, dap, chosen.pop(dap.slot, {}))]
    known = {module.id: module for module in gsdml.modules}
    contents = _Contents(gsdml, dap.modules, dap.physical_slots, known, "module")
    for slot, module in contents.filled(modules or {}).items():
        plugged.append(plugger.plug(slot, module, chosen.pop(slot, {})))
    if chosen:
        slot = next(iter(chosen))
        raise PlugError(f"slot {slot} has no module, submodules need one", slot=slot)
    station = PluggedStation(gsdml, dap, tuple(plugged))
    _check_lengths(station)
    return station
