"""A record of a slave that a program reads or writes: one request of DP-V1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.profibus.wire.dpv1 import NEGATIVE

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.protocols.profibus.record_request import RecordRequest

__all__ = ["RecordJob"]

#: Error_Decode of DP-V1.
DPV1: Final = 0x80


@dataclass(slots=True, eq=False)
class RecordJob:
    """See :class:`pnfarm.buses.controller.RecordAccess`."""

    request: RecordRequest
    _asked: bool = False

    def advance(self, ask: Callable[[RecordRequest], None], _now: int) -> None:
        """Ask once; the master has the rest."""
        if not self._asked and not self.request.done:
            self._asked = True
            ask(self.request)

    @property
    def done(self) -> bool:
        return self.request.done

    @property
    def data(self) -> bytes | None:
        return self.request.data

    @property
    def failure(self) -> str:
        return self.request.error

    @property
    def code(self) -> int:
        """Function_Num, Error_Decode, Error_Code_1 and 2 of the slave's refusal."""
        if self.request.refused is None:
            return 0
        code1, code2 = self.request.refused
        return (self.request.function | NEGATIVE) << 24 | DPV1 << 16 | code1 << 8 | code2
