"""A record of the drive that a program reads or writes, as a PLC does with RDREC and WRREC: asked for, answered later.

::

    self.answer = self.write_record(47, request)  # and some cycles later:
    if self.answer.done and not self.answer.failure:
        ...

The controller begins it after the programs of the cycle, so that only the program's own thread is in the program.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.controller import RecordAccess

__all__ = ["MOST_OPEN", "ProgramRecord"]

HIGHEST_INDEX = 0xFFFF
#: Octets of a record that is written: as many as a read accepts.
MOST_OCTETS = 4096
#: Accesses of one axis that are not done.
MOST_OPEN = 16


class ProgramRecord:
    """One access; ``data`` is written where it was given.  Everything else holds once it is ``done``."""

    def __init__(self, index: int, data: bytes | None) -> None:
        if index not in range(HIGHEST_INDEX + 1):
            raise ValueError(f"record index {index!r}: allowed are 0 to {HIGHEST_INDEX}")
        if data is not None and not (isinstance(data, bytes) and 0 < len(data) <= MOST_OCTETS):
            raise ValueError(f"the data of a record are 1 to {MOST_OCTETS} octets, as bytes")
        self.index = index
        self.written = data
        self._access: RecordAccess | None = None
        self._refused = ""

    def begin(self, access: RecordAccess) -> None:
        """Called by the controller."""
        self._access = access

    def refuse(self, why: str) -> None:
        """Called by the controller: it cannot begin."""
        self._refused = why

    @property
    def done(self) -> bool:
        return bool(self._refused) or (self._access is not None and self._access.done)

    @property
    def data(self) -> bytes:
        """What was read; empty of a write, and of a read that failed."""
        return b"" if self._access is None or self.written is not None else self._access.data or b""

    @property
    def failure(self) -> str:
        """Why it failed, in words; empty where it did not."""
        return self._refused if self._access is None else self._access.failure

    @property
    def status(self) -> int:
        """The drive's four octets, as a PLC has them in STATUS (0xDE80B500: it works on it still); 0: it gave none."""
        return 0 if self._access is None else self._access.code
