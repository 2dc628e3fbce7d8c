"""How the plugged modules differ from the expected ones: the ModuleDiffBlock and the unusable submodules."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.cm.expected import (
    ArInfo,
    DataDirection,
    DiffApi,
    DiffModule,
    DiffSubmodule,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
    submodule_state,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.description import ModuleDescription, Plugged, SubmoduleDescription
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ExpectedSubmodule

__all__ = ["Holdings", "expected_idents", "module_diff", "unusable_submodules"]


def _healthy(_key: ExpectedKey) -> int:
    return 0


@dataclass(frozen=True, slots=True)
class Holdings:
    """What an AR has of its expected submodules.

    ``locked`` are others', ``pending`` wait for parameters.  ``supervisor``: the AR is one, so that a locked submodule
    reports that its takeover is denied.  ``diagnosis`` gives the diagnosis bits of a submodule's SubmoduleState.
    """

    locked: Mapping[ExpectedKey, ArInfo] = field(default_factory=dict)
    pending: Collection[ExpectedKey] = ()
    supervisor: bool = False
    diagnosis: Callable[[ExpectedKey], int] = _healthy


def _ar_info(key: ExpectedKey, holdings: Holdings) -> tuple[int, bool]:
    """ARInfo, and whether AddInfo says that a takeover is denied."""
    locked = holdings.locked.get(key)
    if locked is not None:
        return locked, holdings.supervisor and locked == ArInfo.LOCKED_BY_IO_CONTROLLER
    return (ArInfo.APPLICATION_READY_PENDING if key in holdings.pending else ArInfo.OWN), False


def _stands_in(real: SubmoduleDescription, expected: ExpectedSubmodule) -> bool:
    lengths = expected.length(DataDirection.INPUT), expected.length(DataDirection.OUTPUT)
    return lengths == (real.input_bytes, real.output_bytes)


def _submodule(
    expected: ExpectedSubmodule, api: int, module: ModuleDescription, holdings: Holdings, *, substitute: bool
) -> DiffSubmodule | None:
    """``substitute``: another module than the expected one, which works in its place."""
    real = module.submodule(expected.subslot)
    if real is None or real.api != api:
        return DiffSubmodule(expected.subslot, 0, submodule_state(IdentInfo.NO_SUBMODULE))
    key = (api, module.slot, expected.subslot)
    info, denied = _ar_info(key, holdings)
    if substitute and _stands_in(real, expected):
        ident_info = IdentInfo.SUBSTITUTE if real.submodule_ident != expected.submodule_ident else IdentInfo.OK
    elif substitute or real.submodule_ident != expected.submodule_ident:
        return DiffSubmodule(expected.subslot, real.submodule_ident, submodule_state(IdentInfo.WRONG))
    else:
        ident_info = IdentInfo.OK
    diagnosis = holdings.diagnosis(key)
    if ident_info == IdentInfo.OK and info == ArInfo.OWN and not diagnosis and not substitute:
        return None
    state = submodule_state(ident_info, info, takeover_denied=denied) | diagnosis
    return DiffSubmodule(expected.subslot, real.submodule_ident, state)


def _module(expected: ExpectedApi, plugged: Plugged, holdings: Holdings) -> DiffModule | None:
    module = plugged.module(expected.slot)
    if module is None:
        return DiffModule(expected.slot, 0, ModuleState.NO_MODULE)
    if module.module_ident != expected.module_ident:
        if plugged.substitutes(expected.slot):
            found = [_submodule(s, expected.api, module, holdings, substitute=True) for s in expected.submodules]
            subs = tuple(s for s in found if s is not None)
        else:
            # "wrong module" is to be avoided (IEC 61158-5-10, ModuleState): a substitute with wrong submodules says
            # more
            wrong = submodule_state(IdentInfo.WRONG)
            reals = [(s.subslot, module.submodule(s.subslot)) for s in expected.submodules]
            subs = tuple(DiffSubmodule(place, real.submodule_ident if real else 0, wrong) for place, real in reals)
        return DiffModule(module.slot, module.module_ident, ModuleState.SUBSTITUTE, subs)
    found = [_submodule(s, expected.api, module, holdings, substitute=False) for s in expected.submodules]
    differing = tuple(s for s in found if s is not None)
    if not differing:
        return None
    return DiffModule(module.slot, module.module_ident, ModuleState.PROPER_MODULE, differing)


def module_diff(
    expected: Iterable[ExpectedApi], plugged: Plugged, holdings: Holdings | None = None
) -> ModuleDiffBlock | None:
    """What differs, or None when everything is as expected."""
    apis: dict[int, list[DiffModule]] = {}
    for entry in expected:
        found = _module(entry, plugged, holdings or Holdings())
        if found is not None:
            apis.setdefault(entry.api, []).append(found)
    if not apis:
        return None
    return ModuleDiffBlock(tuple(DiffApi(api, tuple(modules)) for api, modules in apis.items()))


def expected_idents(expected: Iterable[ExpectedApi]) -> dict[int, tuple[int, dict[int, int]]]:
    """Slot -> the module's ident, and those of its submodules by subslot; of several expectations the first one."""
    found: dict[int, tuple[int, dict[int, int]]] = {}
    for entry in expected:
        module, idents = found.setdefault(entry.slot, (entry.module_ident, {}))
        if module == entry.module_ident:
            for one in entry.submodules:
                idents.setdefault(one.subslot, one.submodule_ident)
    return found


def unusable_submodules(expected: Iterable[ExpectedApi], diff: ModuleDiffBlock | None) -> frozenset[ExpectedKey]:
    """The expected submodules that the diff names: missing, wrong, another AR's, or without their parameters yet."""
    if diff is None:
        return frozenset()
    modules = {(a.api, m.slot): m for a in diff.apis for m in a.modules}
    unusable = set()
    for entry in expected:
        module = modules.get((entry.api, entry.slot))
        if module is None:
            continue
        if module.state == ModuleState.NO_MODULE:
            subslots = {s.subslot for s in entry.submodules}
        else:
            subslots = {
                s.subslot
                for s in module.submodules
                if s.ident_info not in {IdentInfo.OK, IdentInfo.SUBSTITUTE} or s.ar_info != ArInfo.OWN
            }
        unusable |= {(entry.api, entry.slot, subslot) for subslot in subslots}
    return frozenset(unusable)
