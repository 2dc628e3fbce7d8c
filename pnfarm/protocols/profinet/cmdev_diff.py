"""How the plugged modules differ from the expected ones: the ModuleDiffBlock and the unusable submodules."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.blocks_expected import (
    ArInfo,
    DiffApi,
    DiffModule,
    DiffSubmodule,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
    submodule_state,
)

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from pnfarm.protocols.profinet.ar import ExpectedKey
    from pnfarm.protocols.profinet.description import ModuleDescription, Plugged
    from pnfarm.protocols.profinet.wire.blocks_expected import ExpectedApi, ExpectedSubmodule

__all__ = ["module_diff", "unusable_submodules"]


def _submodule(
    expected: ExpectedSubmodule, api: int, module: ModuleDescription, locked: Container[ExpectedKey]
) -> DiffSubmodule | None:
    real = module.submodule(expected.subslot)
    if real is None or real.api != api:
        return DiffSubmodule(expected.subslot, 0, submodule_state(IdentInfo.NO_SUBMODULE))
    if real.submodule_ident != expected.submodule_ident:
        return DiffSubmodule(expected.subslot, real.submodule_ident, submodule_state(IdentInfo.WRONG))
    if (api, module.slot, expected.subslot) in locked:
        state = submodule_state(IdentInfo.OK, ArInfo.LOCKED_BY_IO_CONTROLLER)
        return DiffSubmodule(expected.subslot, real.submodule_ident, state)
    return None


def _module(expected: ExpectedApi, plugged: Plugged, locked: Container[ExpectedKey]) -> DiffModule | None:
    module = plugged.module(expected.slot)
    if module is None:
        return DiffModule(expected.slot, 0, ModuleState.NO_MODULE)
    if module.module_ident != expected.module_ident:
        # "wrong module" is to be avoided (IEC 61158-5-10, ModuleState): a substitute with wrong submodules says more
        wrong = submodule_state(IdentInfo.WRONG)
        subs = []
        for sub in expected.submodules:
            real = module.submodule(sub.subslot)
            subs.append(DiffSubmodule(sub.subslot, real.submodule_ident if real else 0, wrong))
        return DiffModule(module.slot, module.module_ident, ModuleState.SUBSTITUTE, tuple(subs))
    found = [_submodule(s, expected.api, module, locked) for s in expected.submodules]
    differing = tuple(s for s in found if s is not None)
    if not differing:
        return None
    return DiffModule(module.slot, module.module_ident, ModuleState.PROPER_MODULE, differing)


def module_diff(
    expected: Iterable[ExpectedApi], plugged: Plugged, locked: Container[ExpectedKey] = ()
) -> ModuleDiffBlock | None:
    """What differs, or None when everything is as expected.  ``locked`` belongs to another AR."""
    apis: dict[int, list[DiffModule]] = {}
    for entry in expected:
        found = _module(entry, plugged, locked)
        if found is not None:
            apis.setdefault(entry.api, []).append(found)
    if not apis:
        return None
    return ModuleDiffBlock(tuple(DiffApi(api, tuple(modules)) for api, modules in apis.items()))


def unusable_submodules(expected: Iterable[ExpectedApi], diff: ModuleDiffBlock | None) -> frozenset[ExpectedKey]:
    """The expected submodules that the diff names: missing, wrong, or another AR's."""
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
