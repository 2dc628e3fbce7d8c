"""A device as data: identity, modules, limits; and the modules in its slots now.

:class:`DeviceDescription` is made once from a drive model and never changes.  :class:`Plugged` is the part
that changes: a slot for which the description knows several modules (a drive with a module per telegram)
takes the one that the controller expects, with the submodules that it expects (a drive with a submodule per telegram),
unless it was pulled or replaced on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.wire.rtc import REDUCTION_RATIOS, SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = [
    "MAX_REDUCTION",
    "MAX_SUPERVISOR_ARS",
    "DeviceDescription",
    "Im0Description",
    "ImCarrier",
    "Limits",
    "ModuleDescription",
    "Plugged",
    "SlotState",
    "SubmoduleDescription",
]

#: The greatest ReductionRatio.
MAX_REDUCTION = 512
#: Supervisors with IO data at one device.
MAX_SUPERVISOR_ARS = 1
_NO_IDENTS: Mapping[int, int] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class SubmoduleDescription:
    """A submodule in its place; ``input_bytes`` go to the controller, ``output_bytes`` come from it.

    ``name`` is its maker's, for people.
    """

    slot: int
    subslot: int
    api: int
    module_ident: int
    submodule_ident: int
    input_bytes: int = 0
    output_bytes: int = 0
    name: str = ""


@dataclass(frozen=True, slots=True)
class ModuleDescription:
    """A module that one slot can take, with its ``submodules`` at power-on; ``choices`` are others that it takes, in
    their subslots."""

    slot: int
    module_ident: int
    submodules: tuple[SubmoduleDescription, ...]
    choices: tuple[SubmoduleDescription, ...] = ()

    def submodule(self, subslot: int) -> SubmoduleDescription | None:
        return next((s for s in self.submodules if s.subslot == subslot), None)

    def taking(self, idents: Mapping[int, int]) -> ModuleDescription:
        """With the submodules of these idents, by subslot, as far as it takes them."""
        chosen = {s.subslot: s for s in self.choices if idents.get(s.subslot) == s.submodule_ident}
        if not chosen:
            return self
        # what was in their place can come back
        kept = {s.subslot: s for s in self.submodules}
        choices = tuple(dict.fromkeys((*self.choices, *(kept[place] for place in chosen.keys() & kept.keys()))))
        submodules = tuple(one for _, one in sorted((kept | chosen).items()))
        return replace(self, submodules=submodules, choices=choices)


@dataclass(frozen=True, slots=True)
class Im0Description:
    """I&M0.  ``software_revision`` is a prefix letter ('V') and three numbers; the texts may be shorter than
    their fields (20 and 16 octets)."""

    order_id: str
    serial_number: str
    hardware_revision: int = 1
    software_revision: tuple[str, int, int, int] = ("V", 1, 0, 0)
    revision_counter: int = 0
    profile_id: int = 0
    profile_specific_type: int = 0
    #: IM_Supported: bit 1 for I&M1 ... bit 4 for I&M4; I&M0 is always there.
    im_supported: int = 0


@dataclass(frozen=True, slots=True)
class ImCarrier:
    """A submodule with I&M data of its own; they may represent its whole module or the device as well.

    ``im0`` None is the device's I&M0.
    """

    slot: int
    subslot: int
    module: bool = False
    device: bool = False
    im0: Im0Description | None = None


@dataclass(frozen=True, slots=True)
class Limits:
    """What the device refuses at Connect.

    ``min_cycle_ns``: shortest send cycle of a CR; 0 leaves it to ``min_device_interval``.  ``max_cycle_ns``: longest
    one; 0 is none.  With ``strict`` False none of them is enforced.  ``max_ars`` counts IO controllers (more than one:
    a shared device), ``max_supervisor_ars`` supervisors with IO data, ``max_device_access_ars`` the acyclic ones beside
    them.  ``max_input_crs`` and ``max_output_crs`` are those of one AR.
    """

    strict: bool = True
    min_cycle_ns: int = 0
    max_cycle_ns: int = 0
    max_ars: int = 1
    max_supervisor_ars: int = MAX_SUPERVISOR_ARS
    max_device_access_ars: int = 1
    max_input_crs: int = 1
    max_output_crs: int = 1
    max_alarm_data_length: int = 200


@dataclass(frozen=True, slots=True)
class DeviceDescription:
    """One device.

    ``min_device_interval`` counts 31.25 us.  ``modules`` lists, for each slot but the DAP's, every module that it
    can take; the first one of a slot is in it at power-on.  ``send_clocks`` and ``reduction_ratios`` are the
    SendClockFactors and ReductionRatios accepted, which the description file names too.
    ``im_carriers`` are the submodules with I&M data; if none is named, the DAP's first one, for the device.
    ``own_records`` are indexes that its file names although the standard has no such record; ``ignored_records`` those
    of records that are accepted, kept and have no effect.
    """

    vendor_id: int
    device_id: int
    station_type: str
    dap: ModuleDescription
    im0: Im0Description
    modules: tuple[ModuleDescription, ...] = ()
    instance: int = 1
    min_device_interval: int = 32
    send_clocks: Sequence[int] = (8, 16, 32, 64, 128)
    reduction_ratios: Sequence[int] = REDUCTION_RATIOS
    limits: Limits = Limits()
    im_carriers: tuple[ImCarrier, ...] = ()
    own_records: frozenset[int] = frozenset()
    ignored_records: frozenset[int] = frozenset()

    @property
    def carriers(self) -> tuple[ImCarrier, ...]:
        """The submodules with I&M data: at least one, which represents the device."""
        return self.im_carriers or (ImCarrier(self.dap.slot, self.dap.submodules[0].subslot, device=True),)

    @property
    def min_cycle_ns(self) -> int:
        """Shortest cycle that a CR may request; 0 when the limits are lax."""
        if not self.limits.strict:
            return 0
        return max(self.limits.min_cycle_ns, self.min_device_interval * SEND_CLOCK_NS)

    @property
    def max_cycle_ns(self) -> int:
        """Longest cycle that a CR may request; 0 when there is no such limit, or the limits are lax."""
        return self.limits.max_cycle_ns if self.limits.strict else 0

    def module(self, slot: int, module_ident: int) -> ModuleDescription | None:
        """The module of that ident which ``slot`` can take."""
        if slot == self.dap.slot:
            return self.dap if module_ident == self.dap.module_ident else None
        return next((m for m in self.modules if m.slot == slot and m.module_ident == module_ident), None)

    def default_module(self, slot: int) -> ModuleDescription | None:
        """The module in ``slot`` at power-on."""
        if slot == self.dap.slot:
            return self.dap
        return next((m for m in self.modules if m.slot == slot), None)

    @property
    def slots(self) -> tuple[int, ...]:
        """Slots that exist, the DAP's first."""
        return (self.dap.slot, *dict.fromkeys(m.slot for m in self.modules))


@dataclass(frozen=True, slots=True)
class SlotState:
    """State of one slot in :class:`Plugged`.

    ``held``: it does not follow the controller; ``pulled`` is the content before something of it was pulled.
    """

    module: ModuleDescription | None
    held: bool = False
    substitute: bool = False
    pulled: ModuleDescription | None = None


_NOTHING = SlotState(None)


class Plugged:
    """The modules in the slots: a mapping ``(slot, subslot) -> SubmoduleDescription`` that can be changed.

    Only :meth:`follow` and :meth:`take` are the protocol's; :meth:`pull`, :meth:`plug`, :meth:`put` and
    :meth:`restore` are for users and injections.
    """

    __slots__ = ("_description", "_slots")

    def __init__(self, description: DeviceDescription) -> None:
        self._description = description
        self._slots: dict[int, SlotState] = {}
        for slot in description.slots:
            self.restore(slot)

    def follow(self, slot: int, module_ident: int, idents: Mapping[int, int] = _NO_IDENTS) -> None:
        """Take the expected module with the expected submodules, ``idents`` by subslot, if the slot can have them and
        is not held."""
        self.take({slot: self.following(slot, module_ident, idents)})

    def take(self, modules: Mapping[int, ModuleDescription | None]) -> None:
        """Take what :meth:`following` found, by slot."""
        for slot, module in modules.items():
            if module is not None:
                self._slots[slot] = replace(self.state(slot), module=module)

    def following(
        self, slot: int, module_ident: int, idents: Mapping[int, int], *, shared: bool = False
    ) -> ModuleDescription | None:
        """What the slot will have after :meth:`follow`.  ``shared``: another AR uses the slot, whose module stays."""
        present = self.module(slot)
        if self.held(slot):
            return present
        module = present if shared else self._description.module(slot, module_ident)
        return module.taking(idents) if module is not None and module.module_ident == module_ident else present

    def pull(self, slot: int, subslot: int | None = None) -> None:
        """Take a module, or one submodule of it, out, whatever a controller expects, until :meth:`plug`."""
        state = self.state(slot)
        module, rest = state.module, None
        if module is not None and subslot is not None:
            rest = replace(module, submodules=tuple(s for s in module.submodules if s.subslot != subslot))
        self._slots[slot] = replace(state, module=rest, held=True, pulled=state.pulled or module)

    def plug(self, slot: int, module: ModuleDescription | None = None, *, substitute: bool = False) -> None:
        """Put ``module`` into ``slot``, whatever a controller expects; without one, what was pulled.

        A ``substitute`` works in the place of another module: its submodules with the expected lengths are usable.
        """
        if module is None:
            self._slots[slot] = SlotState(self.state(slot).pulled or self._description.default_module(slot))
        else:
            self._slots[slot] = SlotState(module, held=True, substitute=substitute)

    def restore(self, slot: int) -> None:
        """Back to the module of power-on, free to follow again."""
        self._slots[slot] = SlotState(self._description.default_module(slot))

    def state(self, slot: int) -> SlotState:
        """For :meth:`put`."""
        return self._slots.get(slot, _NOTHING)

    def put(self, slot: int, state: SlotState) -> None:
        """The slot as ``state`` says, whatever was there before."""
        self._slots[slot] = state

    def held(self, slot: int) -> bool:
        """A user pulled or plugged here: the slot does not follow the controller."""
        return self.state(slot).held

    def substitutes(self, slot: int) -> bool:
        """The module in ``slot`` was plugged as a substitute for another."""
        return self.state(slot).substitute

    def module(self, slot: int) -> ModuleDescription | None:
        return self.state(slot).module

    def modules(self) -> tuple[ModuleDescription, ...]:
        """In the order of their slots."""
        return tuple(state.module for _, state in sorted(self._slots.items()) if state.module is not None)

    def apis(self) -> tuple[int, ...]:
        """Every API that some submodule belongs to, ascending."""
        return tuple(sorted({s.api for m in self.modules() for s in m.submodules}))

    def submodule(self, api: int, slot: int, subslot: int) -> SubmoduleDescription | None:
        """The submodule there, if it belongs to ``api``."""
        found = self.get((slot, subslot))
        return found if found is not None and found.api == api else None

    def get(self, key: tuple[int, int]) -> SubmoduleDescription | None:
        module = self.module(key[0])
        return module.submodule(key[1]) if module else None

    def __getitem__(self, key: tuple[int, int]) -> SubmoduleDescription:
        found = self.get(key)
        if found is None:
            raise KeyError(key)
        return found

    def __contains__(self, key: tuple[int, int]) -> bool:
        return self.get(key) is not None

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter([(s.slot, s.subslot) for m in self.modules() for s in m.submodules])

    def __len__(self) -> int:
        return sum(len(m.submodules) for m in self.modules())
