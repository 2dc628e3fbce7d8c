"""Layouts of octets as classes: the annotations of a class's fields are its codec.

A :class:`Structure` is a frozen dataclass.  Each field is annotated with what stands on the wire, in the order of the
wire, so that parsing and emitting are written nowhere else::

    class FrameSlot(Structure):
        slot: UInt16
        subslot: UInt16
        frame_offset: UInt16


    class IocrApi(Structure):
        api: UInt32
        data_objects: List16[FrameSlot] = ()

Neighbours of fixed size share one :class:`struct.Struct`, made when the class is.  A module that declares structures
does not postpone the evaluation of its annotations.  Numbers have the byte order of the reader or writer: network
order unless the class is ``little=True``, or the caller says so (DCE/RPC).  Errors are those of
:class:`~pnfarm.wire.octets.Reader` and :class:`~pnfarm.wire.octets.Writer`.
"""

from __future__ import annotations

import re
import struct
from dataclasses import MISSING, dataclass, field, fields
from functools import lru_cache, partial
from ipaddress import IPv4Address
from operator import attrgetter
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Self,
    TypeAlias,
    TypeVar,
    dataclass_transform,
    get_args,
    get_origin,
)
from uuid import UUID

from pnfarm.wire.octets import Reader, Writer, uuid_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from dataclasses import Field

__all__ = [
    "Align",
    "Codec",
    "Count",
    "Fixed",
    "Ip",
    "Length",
    "List8",
    "List16",
    "ListOfRest",
    "Mac",
    "Octets8",
    "Octets16",
    "Outside",
    "Pad",
    "Rest",
    "RestBut",
    "Structure",
    "UInt8",
    "UInt16",
    "UInt32",
    "UInt64",
    "Uuid",
    "When",
    "octets",
    "padded",
]

T = TypeVar("T")
_Values: TypeAlias = "dict[str, Any]"


class Codec:
    """What reads and writes one field of no fixed size; ``values`` are those of the fields before it."""

    __slots__ = ()

    def read(self, r: Reader, values: Mapping[str, Any]) -> Any:
        raise NotImplementedError

    def write(self, w: Writer, value: Any) -> None:
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Fixed:
    """Characters of :mod:`struct`; ``load`` makes the field's value of theirs, ``store`` theirs of it.

    With more than one character ``load`` takes, and ``store`` returns, as many values.
    """

    form: str
    load: Callable[..., Any] | None = None
    store: Callable[[Any], Any] | None = None


@dataclass(frozen=True, slots=True)
class Pad:
    """So many octets before the field: zero when sent, of any value when received."""

    octets: int

    def read(self, r: Reader, _values: _Values) -> None:
        r.skip(self.octets)

    def write(self, w: Writer, _values: Mapping[str, Any]) -> None:
        w.zeros(self.octets)


@dataclass(frozen=True, slots=True)
class Align:
    """Padding before the field up to a multiple of ``width`` octets; where the octets end, it may be missing.

    ``origin``: octets before the first one of this reader or writer that count, too.
    """

    width: int
    origin: int = 0

    def read(self, r: Reader, _values: _Values) -> None:
        r.skip(min(-(r.position + self.origin) % self.width, r.remaining))

    def write(self, w: Writer, _values: Mapping[str, Any]) -> None:
        w.zeros(-(len(w) + self.origin) % self.width)


@dataclass(frozen=True, slots=True)
class When:
    """The field stands on the wire where ``test`` holds of the fields before it and of those outside."""

    test: Callable[[Mapping[str, Any]], bool]
    otherwise: Any = None


class _Outside:
    """The field has its value from what is around the structure, or its default."""


@dataclass(frozen=True)
class Length(Codec):
    """Octets after a number of this ``form``, which counts ``unit`` octets; padding up to ``even`` octets follows."""

    form: str = "H"
    unit: int = 1
    even: int = 1

    def read(self, r: Reader, _values: Mapping[str, Any]) -> bytes:
        size = _number(r, self.form) * self.unit
        data = r.bytes(size)
        r.skip(-size % self.even)
        return data

    def write(self, w: Writer, value: bytes) -> None:
        if len(value) % self.unit:
            raise ValueError(f"{len(value)} octets are not whole words")
        _pack(w, _struct(self.form, w.little), (len(value) // self.unit,))
        w.bytes(value).zeros(-len(value) % self.even)


@dataclass(frozen=True)
class Count:
    """How many items: as a number of this form says, as a function of the fields before, or (None) up to the end."""

    number: str | Callable[[Mapping[str, Any]], int] | None = "H"
    #: Padding after the number.
    align: Align | None = None

    def read(self, r: Reader, values: Mapping[str, Any]) -> int | None:
        count = _number(r, self.number) if isinstance(self.number, str) else self.number and self.number(values)
        if self.align:
            self.align.read(r, {})
        return count

    def write(self, w: Writer, count: int) -> None:
        if isinstance(self.number, str):
            _pack(w, _struct(self.number, w.little), (count,))
        if self.align:
            self.align.write(w, {})


@dataclass(frozen=True)
class RestBut(Codec):
    """All octets up to the end, without so many."""

    octets: int

    def read(self, r: Reader, _values: Mapping[str, Any]) -> bytes:
        return r.bytes(max(0, r.remaining - self.octets))

    def write(self, w: Writer, value: bytes) -> None:
        w.bytes(value)


@lru_cache(64)
def _struct(form: str, little: bool) -> struct.Struct:
    return struct.Struct(("<" if little else ">") + form)


def _number(r: Reader, form: str) -> int:
    number: int = r.unpack(_struct(form, r.little))[0]
    return number


def _values_in(form: str) -> int:
    return sum(token[-1] != "x" for token in _tokens(form))


def _tokens(form: str) -> list[str]:
    """One for each value or piece of padding: ``H2x6s``."""
    return re.findall(r"\d*[a-zA-Z?]", form)


def _short(layout: struct.Struct, r: Reader) -> None:
    """Raise what a reader of one value after the other would."""
    for token in _tokens(layout.format[1:]):
        r.skip(struct.calcsize(layout.format[0] + token))


def _pack(w: Writer, layout: struct.Struct, values: tuple[Any, ...] | list[Any]) -> None:
    try:
        w.bytes(layout.pack(*values))
    except struct.error as exc:
        for token, value in zip((t for t in _tokens(layout.format[1:]) if t[-1] != "x"), values, strict=True):
            one = struct.Struct(layout.format[0] + token)
            try:
                one.pack(value)
            except struct.error:
                raise ValueError(f"{value} does not fit in {one.size} octets") from exc
        raise


class _Run:
    """Neighbouring fields of fixed size: name of each, its place among the unpacked values, load and store."""

    __slots__ = ("layout", "names", "parts", "plain")

    def __init__(self, little: bool) -> None:
        self.layout = _struct("", little)
        self.names: tuple[str, ...] = ()
        self.parts: list[tuple[str, slice | int, Callable[..., Any] | None, Callable[[Any], Any] | None]] = []
        self.plain = True

    def add(self, name: str, fixed: Fixed, pad: int) -> None:
        little, form = self.layout.format[0] == "<", self.layout.format[1:]
        begin, count = _values_in(form), _values_in(fixed.form)
        load, store = fixed.load, fixed.store
        self.layout = _struct(form + (f"{pad}x" if pad else "") + fixed.form, little)
        self.names += (name,)
        self.parts.append((name, begin if count == 1 else slice(begin, begin + count), load, store))
        self.plain = self.plain and count == 1 and load is None and store is None

    def load(self, raw: tuple[Any, ...], values: _Values) -> None:
        if self.plain:
            values.update(zip(self.names, raw, strict=True))
            return
        for name, place, load, _ in self.parts:
            found = raw[place]
            values[name] = found if load is None else load(*found) if isinstance(place, slice) else load(found)

    def store(self, values: Mapping[str, Any]) -> list[Any]:
        if self.plain:
            return [values[name] for name in self.names]
        raw: list[Any] = []
        for name, place, _, store in self.parts:
            value = values[name] if store is None else store(values[name])
            raw += value if isinstance(place, slice) else (value,)
        return raw

    def read(self, r: Reader, values: _Values) -> None:
        if r.remaining < self.layout.size:
            _short(self.layout, r)
        self.load(r.unpack(self.layout), values)

    def write(self, w: Writer, values: Mapping[str, Any]) -> None:
        _pack(w, self.layout, self.store(values))


@dataclass(frozen=True, slots=True)
class _One:
    """A field of no fixed size."""

    name: str
    codec: Codec

    def read(self, r: Reader, values: _Values) -> None:
        values[self.name] = self.codec.read(r, values)

    def write(self, w: Writer, values: Mapping[str, Any]) -> None:
        self.codec.write(w, values[self.name])


@dataclass(frozen=True, slots=True)
class _Conditional:
    name: str
    when: When
    step: _Run | _One

    def read(self, r: Reader, values: _Values) -> None:
        if self.when.test(values):
            self.step.read(r, values)
        else:
            values[self.name] = self.when.otherwise

    def write(self, w: Writer, values: Mapping[str, Any]) -> None:
        if self.when.test(values):
            self.step.write(w, values)


@dataclass(frozen=True, slots=True)
class _Nested(Codec):
    kind: type[Structure]

    def read(self, r: Reader, _values: Mapping[str, Any]) -> Structure:
        return self.kind.read(r)

    def write(self, w: Writer, value: Structure) -> None:
        value.write(w)


@dataclass(frozen=True, slots=True)
class _Items(Codec):
    """Items of no fixed size."""

    count: Count
    item: Codec

    def read(self, r: Reader, values: Mapping[str, Any]) -> tuple[Any, ...]:
        count = self.count.read(r, values)
        found: list[Any] = []
        while r.remaining if count is None else len(found) < count:
            found.append(self.item.read(r, values))
        return tuple(found)

    def write(self, w: Writer, value: tuple[Any, ...]) -> None:
        self.count.write(w, len(value))
        for item in value:
            self.item.write(w, item)


class _FixedItems(Codec):
    """Items of one fixed size, read at once."""

    __slots__ = ("_count", "_item", "_layout", "_many")

    def __init__(self, count: Count, item: Fixed, little: bool) -> None:
        self._count, self._item, self._layout = count, item, _struct(item.form, little)
        self._many = _values_in(item.form) > 1

    def read(self, r: Reader, values: Mapping[str, Any]) -> tuple[Any, ...]:
        size, load = self._layout.size, self._item.load
        if (count := self._count.read(r, values)) is None:
            count = -(-r.remaining // size)
        if count * size > r.remaining:
            r.skip(r.remaining // size * size)
            _short(self._layout, r)
        raw = self._layout.iter_unpack(r.bytes(count * size))
        return tuple(value for (value,) in raw) if load is None else tuple(load(*values) for values in raw)

    def write(self, w: Writer, value: tuple[Any, ...]) -> None:
        self._count.write(w, len(value))
        store, pack = self._item.store or _itself, self._layout.pack
        try:
            w.bytes(
                b"".join(
                    [pack(*store(item)) for item in value] if self._many else [pack(store(item)) for item in value]
                )
            )
        except struct.error:
            for item in value:
                _pack(w, self._layout, store(item) if self._many else (store(item),))


def _codec(kind: Any, little: bool) -> tuple[Fixed | Codec, list[Any]]:
    """The codec of an annotation, and what else it says."""
    marks: list[Any] = []
    if get_origin(kind) is Annotated:
        kind, *marks = get_args(kind)
    for mark in marks:
        if isinstance(mark, Fixed | Codec):
            return mark, marks
        if mark is _UUIDS:
            return _UUIDS[little], marks
        if isinstance(mark, Count):
            item = _codec(get_args(kind)[0], little)[0]
            items = _FixedItems(mark, item, little) if isinstance(item, Fixed) else _Items(mark, item)
            return items, marks
    if isinstance(kind, type) and issubclass(kind, Structure):
        return kind.plan(little).fixed or _Nested(kind), marks
    parts = [_codec(part, little)[0] for part in get_args(kind)] if get_origin(kind) is tuple else []
    if not parts or not all(isinstance(part, Fixed) and not part.load for part in parts):
        raise TypeError(f"{kind} does not say how it stands on the wire")
    return Fixed("".join(part.form for part in parts if isinstance(part, Fixed)), _together), marks


def _itself(value: Any) -> Any:
    return value


def _together(*values: Any) -> tuple[Any, ...]:
    return values


class _Plan:
    """The steps of a structure in one byte order; ``fixed`` where it is one run of fields."""

    def __init__(self, cls: type[Structure], order: tuple[str, ...], little: bool) -> None:
        self.outside: _Values = {}
        self.steps: list[_Run | _One | Align | Pad | _Conditional] = []
        named = {one.name: one for one in fields(cls)}  # type: ignore[arg-type]  # every subclass is a dataclass
        for name in order or named:
            self._add(named[name], little)
        self.fixed: Fixed | None = None
        plain = cls.read.__func__ is Structure.read.__func__ and cls.write is Structure.write  # type: ignore[attr-defined]
        if plain and len(self.steps) == 1 and not self.outside and isinstance(run := self.steps[0], _Run):
            make, many = cls.make, _values_in(run.layout.format[1:]) > 1

            def load(*raw: Any) -> Structure:
                values: _Values = {}
                run.load(raw, values)
                return make(values)

            def store(value: Structure) -> Any:
                raw = run.store(vars(value))
                return raw if many else raw[0]

            stored = attrgetter(*run.names) if run.plain else store
            self.fixed = Fixed(run.layout.format[1:], load, stored)

    def _add(self, one: Field[Any], little: bool) -> None:
        if _Outside in get_args(one.type):
            if one.default is not MISSING:
                self.outside[one.name] = one.default
            return
        codec, marks = _codec(one.type, little)
        when = next((mark for mark in marks if isinstance(mark, When)), None)
        self.steps += [mark for mark in marks if isinstance(mark, Align)]
        last = self.steps[-1] if self.steps else None
        if isinstance(codec, Fixed):
            run = last if isinstance(last, _Run) and not when else _Run(little)
            run.add(one.name, codec, sum(mark.octets for mark in marks if isinstance(mark, Pad)))
            if run is last:
                return
            step: _Run | _One = run
        else:
            self.steps += [mark for mark in marks if isinstance(mark, Pad)]
            step = _One(one.name, codec)
        self.steps.append(_Conditional(one.name, when, step) if when else step)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Structure:
    """A frozen dataclass that is read and written as its fields are annotated.

    ``little``: numbers are little-endian where the caller does not say.  ``wire``: names of the fields in the order of
    the wire, where that is another one.
    """

    _little: ClassVar[bool] = False
    _order: ClassVar[tuple[str, ...]] = ()
    _plans: ClassVar[dict[bool, _Plan]] = {}

    def __init_subclass__(
        cls, *, little: bool | None = None, wire: str = "", kw_only: bool = False, **more: Any
    ) -> None:
        super().__init_subclass__(**more)
        dataclass(frozen=True, kw_only=kw_only)(cls)
        cls._little = cls._little if little is None else little
        cls._order = tuple(wire.split())
        cls._plans = {cls._little: _Plan(cls, cls._order, cls._little)}

    @classmethod
    def plan(cls, little: bool) -> _Plan:
        """How to read and write in this byte order."""
        if little not in cls._plans:
            cls._plans[little] = _Plan(cls, cls._order, little)
        return cls._plans[little]

    @classmethod
    def make(cls, values: dict[str, Any]) -> Self:
        """One with these values for all of its fields."""
        new = object.__new__(cls)
        # one by one: the values then need no dictionary of their own, 200 octets less for each that is kept
        for name, value in values.items():
            object.__setattr__(new, name, value)
        return new

    @classmethod
    def read(cls, r: Reader, **outside: Any) -> Self:
        """The next one; ``outside`` are fields that do not stand in it.  Raises :class:`DecodeError`."""
        plan = cls.plan(r.little)
        values = {**plan.outside, **outside}
        for step in plan.steps:
            step.read(r, values)
        return cls.make(values)

    @classmethod
    def parse(cls, data: bytes | bytearray | memoryview, *, little_endian: bool | None = None, **outside: Any) -> Self:
        """From octets that hold nothing else.  Raises :class:`DecodeError`."""
        r = Reader(data, cls._little if little_endian is None else little_endian)
        value = cls.read(r, **outside)
        r.expect_end()
        return value

    def write(self, w: Writer) -> None:
        """Append the octets; :class:`ValueError` when a field does not fit."""
        for step in self.plan(w.little).steps:
            step.write(w, vars(self))

    def emit(self, *, little_endian: bool | None = None) -> bytes:
        """The octets; :class:`ValueError` when a field does not fit."""
        w = Writer(self._little if little_endian is None else little_endian)
        self.write(w)
        return w.getvalue()


def octets(count: int) -> Fixed:
    """So many octets, never more or fewer."""

    def store(value: bytes) -> bytes:
        if len(value) != count:
            raise ValueError(f"{len(value)} octets where {count} are expected")
        return value

    return Fixed(f"{count}s", None, store)


def padded(count: int) -> Fixed:
    """So many octets: fewer are padded with spaces, more are cut."""

    def store(value: bytes) -> bytes:
        return value.ljust(count, b" ")[:count]

    return Fixed(f"{count}s", None, store)


def _mac_octets(value: bytes) -> bytes:
    if len(value) != 6:
        raise ValueError("a MAC address has six octets")
    return value


#: By byte order: a UUID has numbers in it.
_UUIDS = (
    Fixed("16s", partial(uuid_of, little=False), attrgetter("bytes")),
    Fixed("16s", partial(uuid_of, little=True), attrgetter("bytes_le")),
)

UInt8: TypeAlias = Annotated[int, Fixed("B")]
UInt16: TypeAlias = Annotated[int, Fixed("H")]
UInt32: TypeAlias = Annotated[int, Fixed("I")]
UInt64: TypeAlias = Annotated[int, Fixed("Q")]
Mac: TypeAlias = Annotated[bytes, Fixed("6s", None, _mac_octets)]
#: Addresses of one network come again and again.
Ip: TypeAlias = Annotated[IPv4Address, Fixed("I", lru_cache(4096)(IPv4Address), int)]
Uuid: TypeAlias = Annotated[UUID, _UUIDS]
#: Octets after their number, and all octets up to the end.
Octets8: TypeAlias = Annotated[bytes, Length("B")]
Octets16: TypeAlias = Annotated[bytes, Length("H")]
Rest: TypeAlias = Annotated[bytes, RestBut(0)]
#: Items after their number, and all items up to the end.
List8: TypeAlias = Annotated[tuple[T, ...], Count("B")]
List16: TypeAlias = Annotated[tuple[T, ...], Count("H")]
ListOfRest: TypeAlias = Annotated[tuple[T, ...], Count(None)]
Outside: TypeAlias = Annotated[T, _Outside]
