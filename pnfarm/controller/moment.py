"""A moment of objects in this process: everything that can be reached from one of them, to be put back later.

Each object stays the object that it is, and gets the contents back that it had: who refers to it, and the addresses at
which compiled code finds an array, remain right.  Objects that are new since then are dropped by those that hold them.
Threads, locks and files are no contents: they are left as they are.
"""

from __future__ import annotations

import gc
import re
import types
from collections import OrderedDict, deque
from datetime import datetime, timedelta
from decimal import Decimal
from enum import Enum
from functools import partial
from random import Random
from struct import Struct
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pnfarm.user_code.caller import Caller

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["Moment"]

#: What has no contents of its own that change, nor refers to anything that has.
_PLAIN = (
    bool, int, float, complex, str, bytes, range, slice, type(None), type(NotImplemented), type(...), type, Enum,
    types.ModuleType, types.BuiltinFunctionType, types.GetSetDescriptorType, types.MemberDescriptorType,
    types.MethodDescriptorType, types.WrapperDescriptorType, types.MethodWrapperType, types.CodeType,
    types.GenericAlias, types.TracebackType, re.Pattern, Struct, Decimal, datetime, timedelta, np.dtype,
)  # fmt: skip
#: What does not change, but refers to what may.
_FIXED = (tuple, frozenset, types.MethodType, types.MappingProxyType, property, partial, classmethod, staticmethod)
#: Where the classes are from whose objects stay as they are: of threads and files, and machine code.
_APART = frozenset({"threading", "_thread", "queue", "_queue", "asyncio", "logging", "_io", "numba"})
#: A name of an attribute that an object does not have.
_MISSING = object()


class Moment:
    """``left_out``: the kinds of objects whose contents it does not know; they stay as they are."""

    def __init__(self, root: object) -> None:
        self._root = root
        #: Each object, so that it lives, and what puts its contents back.
        self._contents: list[tuple[object, Callable[[], object]]] = []
        left_out: set[str] = set()
        seen: dict[int, object] = {}
        waiting: list[Any] = [root]
        while waiting:
            one = waiting.pop()
            if id(one) in seen or isinstance(one, _PLAIN) or _is_apart(one):
                continue
            seen[id(one)] = one
            found = self._note(one)
            if found is None:
                left_out.add(f"{type(one).__module__}.{type(one).__qualname__}")
            else:
                waiting.extend(found)
        self.left_out = tuple(sorted(left_out))

    def is_of(self, root: object) -> bool:
        """Whether it was taken of this object."""
        return self._root is root

    def restore(self) -> None:
        """Put everything back; this may be done several times."""
        for _, put_back in self._contents:
            put_back()

    def _keep(self, one: object, put_back: Callable[[], object]) -> None:
        self._contents.append((one, put_back))

    def _note(self, one: Any) -> Iterable[Any] | None:
        """Keep the contents of an object itself; returns what it refers to, None for an unknown kind."""
        if isinstance(one, types.FunctionType):
            return [*(one.__closure__ or ()), *(one.__defaults__ or ()), *(one.__kwdefaults__ or {}).values()]
        if isinstance(one, types.CellType):
            return self._note_cell(one)
        if isinstance(one, np.ndarray):
            return self._note_array(one)
        if isinstance(one, np.generic):
            # a row of a table has the table's memory
            return [one.base] if isinstance(one, np.void) else []
        if isinstance(one, memoryview):
            return [one.obj]
        inside: list[Any] = []
        known = isinstance(one, _FIXED)
        if known:
            inside += gc.get_referents(one)
        for kind, note in self._COLLECTIONS.items():
            if isinstance(one, kind):
                inside += note(self, one)
                known = True
                break
        # a class of Python, not one of the interpreter: it has attributes
        slots = [place for kind in type(one).__mro__ for place in _slots(kind)]
        if hasattr(one, "__dict__"):
            kept = {name: value for name, value in one.__dict__.items() if not _is_apart(value)}
            self._keep(one, partial(_put_attributes, one.__dict__, kept))
            inside += kept.values()
            known = True
        if slots:
            values = [(place, value) for place in slots if not _is_apart(value := _value(place, one))]
            self._keep(one, partial(_put_slots, one, values))
            inside += [value for _, value in values]
            known = True
        return inside if known or type(one) is object or _has_nothing(type(one)) else None

    def _note_cell(self, cell: Any) -> list[Any]:
        try:
            value = cell.cell_contents
        except ValueError:  # empty
            return []
        self._keep(cell, partial(setattr, cell, "cell_contents", value))
        return [value]

    def _note_array(self, array: Any) -> list[Any]:
        """The memory behind it, whatever view of it this is."""
        if isinstance(array.base, np.ndarray):
            return [array.base]
        if array.flags.writeable:
            self._keep(array, partial(np.copyto, array, array.copy()))
        return list(array.flat) if array.dtype.hasobject else []

    def _note_dict(self, one: Any) -> list[Any]:
        kind = OrderedDict if isinstance(one, OrderedDict) else dict
        kept = list(kind.items(one))
        self._keep(one, partial(_put_items, kind, one, kept))
        return [part for item in kept for part in item]

    def _note_list(self, one: list[Any]) -> list[Any]:
        kept = list(one)
        self._keep(one, partial(list.__setitem__, one, slice(None), kept))
        return kept

    def _note_set(self, one: set[Any]) -> list[Any]:
        kept = list(one)
        self._keep(one, partial(_put_members, set, one, kept))
        return kept

    def _note_deque(self, one: deque[Any]) -> list[Any]:
        kept = list(one)
        self._keep(one, partial(_put_members, deque, one, kept))
        return kept

    def _note_octets(self, one: bytearray) -> list[Any]:
        self._keep(one, partial(bytearray.__setitem__, one, slice(None), bytes(one)))
        return []

    def _note_random(self, one: Random) -> list[Any]:
        self._keep(one, partial(one.setstate, one.getstate()))
        return []

    def _note_generator(self, one: np.random.Generator) -> list[Any]:
        bits = one.bit_generator
        self._keep(one, partial(setattr, bits, "state", bits.state))
        return []

    _COLLECTIONS: ClassVar[dict[type, Callable[[Moment, Any], list[Any]]]] = {
        dict: _note_dict,
        list: _note_list,
        set: _note_set,
        deque: _note_deque,
        bytearray: _note_octets,
        Random: _note_random,
        np.random.Generator: _note_generator,
    }


def _is_apart(one: object) -> bool:
    """Whether it is no content: a thread, what threads have in common, a file."""
    return isinstance(one, Caller) or type(one).__module__.partition(".")[0] in _APART


def _slots(kind: type) -> list[Any]:
    if "__slots__" not in vars(kind):
        return []
    return [one for one in vars(kind).values() if isinstance(one, types.MemberDescriptorType)]


def _has_nothing(kind: type) -> bool:
    """Whether it is a class of Python without attributes."""
    return all("__slots__" in vars(one) or one is object for one in kind.__mro__)


def _value(place: Any, one: object) -> Any:
    try:
        return place.__get__(one)
    except AttributeError:
        return _MISSING


def _put_slots(one: object, values: list[tuple[Any, Any]]) -> None:
    for place, value in values:
        if value is not _MISSING:
            place.__set__(one, value)
        elif _value(place, one) is not _MISSING:
            place.__delete__(one)


def _put_attributes(attributes: dict[str, Any], kept: dict[str, Any]) -> None:
    """One by one, because a dictionary of attributes that was emptied is slower."""
    for name in [name for name, value in attributes.items() if name not in kept and not _is_apart(value)]:
        del attributes[name]
    for name, value in kept.items():
        if attributes.get(name, _MISSING) is not value:
            attributes[name] = value


def _put_items(kind: Any, one: Any, kept: list[tuple[Any, Any]]) -> None:
    kind.clear(one)
    kind.update(one, kept)


def _put_members(kind: Any, one: Any, kept: list[Any]) -> None:
    kind.clear(one)
    (kind.update if kind is set else kind.extend)(one, kept)
