"""Data of DP of which the length, and perhaps the first octet, shows whether they are what they ought to be."""

from typing import Any, ClassVar, Self

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import Structure
from pnfarm.wire.octets import Reader, Writer

__all__ = ["Sized"]


class Sized(Structure):
    """``sizes``: octets of one that is right; ``function``: the octet before its fields, if there is one.

    ``reason`` and ``text`` (with a place for the number of octets) are those of the error for any other.
    """

    _sizes: ClassVar[range] = range(0)
    _function: ClassVar[int | None] = None
    _error: ClassVar[tuple[str, str]] = "", ""

    def __init_subclass__(
        cls, *, sizes: range, text: str, reason: str = "bad-length", function: int | None = None, **more: Any
    ) -> None:
        super().__init_subclass__(**more)
        cls._sizes, cls._function, cls._error = sizes, function, (reason, text)

    @classmethod
    def read(cls, r: Reader, **outside: Any) -> Self:
        size = r.remaining
        if size not in cls._sizes or (cls._function is not None and r.u8() != cls._function):
            reason, text = cls._error
            raise DecodeError(reason, text.format(size))
        return super().read(r, **outside)

    def write(self, w: Writer) -> None:
        if self._function is not None:
            w.u8(self._function)
        super().write(w)
