"""A record that a master reads or writes: asked for, and answered later."""

from __future__ import annotations

from dataclasses import dataclass, field

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.dpv1 import NEGATIVE, Access, Function, parse_access, parse_refusal

__all__ = ["RecordRequest"]


@dataclass(slots=True, eq=False)
class RecordRequest:
    """``data``: what is written, or was read.  ``refused``: Error_Code_1 and 2 of a negative response."""

    function: Function
    slot: int
    index: int
    length: int
    data: bytes = b""
    done: bool = False
    refused: tuple[int, int] | None = None
    error: str = ""
    due_ns: int = 0
    #: Whether it was sent, so that polls fetch its answer.
    sent: bool = field(default=False, repr=False)

    @classmethod
    def read(cls, slot: int, index: int, length: int) -> RecordRequest:
        return cls(Function.READ, slot, index, length)

    @classmethod
    def write(cls, slot: int, index: int, data: bytes) -> RecordRequest:
        return cls(Function.WRITE, slot, index, len(data), data)

    @property
    def ok(self) -> bool:
        return self.done and not self.error

    def octets(self) -> bytes:
        return Access(self.function, self.slot, self.index, self.length, self.data).emit()

    def fail(self, why: str) -> None:
        self.done, self.error = True, why

    def take(self, octets: bytes) -> bool:
        """An answer of the slave; False where it is none of this request."""
        try:
            if octets and octets[0] == self.function | NEGATIVE:
                refusal = parse_refusal(octets)
                self.refused = refusal.code1, refusal.code2
                self.fail(f"refused with 0x{refusal.code1:02X} 0x{refusal.code2:02X}")
                return True
            answer = parse_access(octets)
        except DecodeError as exc:
            self.fail(f"an answer that cannot be read: {exc}")
            return True
        if answer.function != self.function:
            return False
        if self.function == Function.READ:
            self.data = answer.data
        self.done = True
        return True
