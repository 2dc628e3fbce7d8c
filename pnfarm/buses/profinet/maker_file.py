"""What a running drive has of its maker's GSDML file beside its identity: texts of diagnoses, parameter records."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.profinet.gsdml.document import (
        Dap,
        Gsdml,
        InterfaceSubmodule,
        ModuleItem,
        PortSubmodule,
        SubmoduleItem,
    )
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord

__all__ = ["MakerFile"]


@dataclass(frozen=True)
class MakerFile:
    """``dap`` is the access point that the drive has."""

    document: Gsdml
    dap: Dap

    @cached_property
    def catalogue(self) -> DiagnosisCatalogue:
        """The diagnoses that the file names."""
        return DiagnosisCatalogue(self.document)

    @cached_property
    def indexes(self) -> frozenset[int]:
        """Of every record that a submodule of the drive may have."""
        submodules = chain.from_iterable(map(self._of, self._holders()))
        return frozenset(record.index for one in submodules for record in one.records)

    def records(self, module: int, submodule: int) -> tuple[ParameterRecord, ...]:
        """Of a submodule, by the idents of its module and itself; none for one that the file does not have there."""
        holders = (holder for holder in self._holders() if holder.ident == module)
        return next((one.records for holder in holders for one in self._of(holder) if one.ident == submodule), ())

    def _holders(self) -> Iterator[Dap | ModuleItem]:
        yield self.dap
        yield from self.document.modules

    def _of(self, holder: Dap | ModuleItem) -> Iterator[SubmoduleItem | InterfaceSubmodule | PortSubmodule]:
        if holder is self.dap:
            yield from self.dap.interfaces
        plugged = (self.document.submodule(ref.target) for ref in holder.useable)
        yield from chain(holder.submodules, holder.ports, (one for one in plugged if one is not None))
