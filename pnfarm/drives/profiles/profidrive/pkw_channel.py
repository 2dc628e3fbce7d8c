"""The drive's end of the cyclic parameter channel (PKW): a task as it stands in the set points, an answer for the words
that are sent back.

A task is carried out once, when it is new: when any of the eight octets is another one than before.  Its answer stays
until the next task; while a value is asked for, the answer follows it (profile, "PKW mechanism").  Task 0 has answer 0.

What a task identifier asks for, and which identifiers answer it, is data of the model
(:class:`~pnfarm.drives.profiles.profidrive.pkw.ParameterWords`); strings go through a cache of the drive's, four octets
at a time (Moog MSD manual 8.2.4, "Transmission of character strings").
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import Parameter, ParameterError, ParameterErrorNumber, refusal
from pnfarm.drives.profiles.profidrive.description import describe
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw, emit_pkw, parse_pkw

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.drives.profiles.profidrive.pkw import ParameterWords

__all__ = ["OTHER_ERROR", "PkwChannel"]

#: Table 8.19: what has no number of its own.
OTHER_ERROR = 18
#: Numbers that mean here what they mean in base mode; the profile's, of which table 8.19 leaves out those from 6 to 16.
_SAME_NUMBERS = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 9, 11, 15, 17})
#: Octets of the cache: what a length of one octet can say.
CACHE_OCTETS = 255
#: Octets of a string in one task.
STEP = 4


class PkwChannel:
    """The channel of one drive over its parameters; ``words`` are the model's identifiers.

    ``repeats``: the answer is a value to be kept up to date: call :meth:`answer` again with the
    same octets every now and then.
    """

    __slots__ = ("_answer", "_cache", "_store", "_task", "_tasks", "_words", "repeats")

    def __init__(self, store: ParameterStore, words: ParameterWords) -> None:
        self._store = store
        self._words = words
        self._tasks: dict[str, Callable[[Pkw], Pkw]] = {
            "read": lambda task: self._read(task, array=False),
            "write-word": lambda task: self._write(task, array=False, double=False),
            "write-double-word": lambda task: self._write(task, array=False, double=True),
            "describe": self._describe,
            "read-array": lambda task: self._read(task, array=True),
            "write-array-word": lambda task: self._write(task, array=True, double=False),
            "write-array-double-word": lambda task: self._write(task, array=True, double=True),
            "cache-write": self._write_cache,
            "cache-store": self._store_cache,
            "cache-load": self._load_cache,
            "cache-read": self._read_cache,
        }
        self.reset()

    def reset(self) -> None:
        """The connection went down: there is no task, and the cache is empty."""
        self._task = self._answer = emit_pkw(NO_TASK)
        self._cache = b""
        self.repeats = False

    def answer(self, octets: bytes) -> bytes:
        """The eight octets that answer these; an unchanged task is not carried out again, unless it reads."""
        if octets != self._task or self.repeats:
            self._task = octets
            task = parse_pkw(octets)
            self._answer = emit_pkw(self._carry_out(task))
        return self._answer

    # inside

    def _carry_out(self, task: Pkw) -> Pkw:
        name = self._words.tasks[task.identifier] if task.identifier < len(self._words.tasks) else "-"
        self.repeats = name in {"read", "read-array", "describe"}
        if name == "none":
            return NO_TASK
        try:
            if name not in self._tasks:
                raise ParameterError(ParameterErrorNumber.SERVICE_NOT_SUPPORTED)
            return self._tasks[name](task)
        except ParameterError as exc:
            number = exc.number if exc.number in _SAME_NUMBERS else OTHER_ERROR
            return replace(task, identifier=self._words.error, value=number)

    def _row(self, pnu: int) -> Parameter:
        parameter = self._store.model.parameters.get(pnu)
        if parameter is None:
            raise ParameterError(ParameterErrorNumber.IMPERMISSIBLE_PNU)
        return parameter

    def _place(self, task: Pkw, *, array: bool) -> tuple[Parameter, int]:
        """The parameter and the element: subindex 0 and 1 are element 0, 2 is element 1 (8.2.4, "Sub index").

        A parameter that is not an array has element 0 and takes no task for arrays; an array takes tasks of both kinds.
        """
        parameter = self._row(task.pnu)
        element = max(task.subindex - 1, 0)
        if not parameter.elements and (array or element):
            raise refusal(ParameterErrorNumber.NO_ARRAY, parameter)
        return parameter, element

    def _value_answer(self, task: Pkw, parameter: Parameter, value: int, *, array: bool) -> Pkw:
        words = self._words
        double = parameter.octets > 2
        single, several = (words.double_word, words.array_double_word) if double else (words.word, words.array_word)
        bits = 32 if double else 16
        return replace(task, identifier=several if array else single, value=value & ((1 << bits) - 1))

    def _read(self, task: Pkw, *, array: bool) -> Pkw:
        parameter, element = self._place(task, array=array)
        return self._value_answer(task, parameter, self._store.read(task.pnu, element)[0], array=array)

    def _write(self, task: Pkw, *, array: bool, double: bool) -> Pkw:
        """A value of one octet travels as a word; what does not fit in it is beyond its limits."""
        parameter, element = self._place(task, array=array)
        if not parameter.writable:
            raise refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter)
        if double != (parameter.octets > 2):
            raise refusal(ParameterErrorNumber.INCORRECT_DATA_TYPE, parameter)
        bits = 32 if double else 16
        value = task.value & ((1 << bits) - 1)
        if parameter.signed and value >> (bits - 1):
            value -= 1 << bits
        self._store.write(task.pnu, element, [value])
        return self._value_answer(task, parameter, value, array=array)

    def _describe(self, task: Pkw) -> Pkw:
        """Table 8.15: one element, of a text the first four octets; elements of two octets stand in the last word."""
        parameter = self._row(task.pnu)
        if not task.subindex:
            raise refusal(ParameterErrorNumber.FAULTY_SUBINDEX, parameter)
        texts = parameter.pnu in self._store.model.parameter_texts
        octets = describe(parameter, task.subindex, changed=self._store.changed(parameter), texts=texts)
        return replace(task, identifier=self._words.description, value=int.from_bytes(octets[:4], "big"))

    # strings

    @staticmethod
    def _start(task: Pkw) -> int:
        """Where in the cache the four octets stand: 0 and 1 are its beginning, else the subindex itself."""
        return 0 if task.subindex <= 1 else task.subindex

    def _text(self, pnu: int) -> Parameter:
        parameter = self._row(pnu)
        if not parameter.text:
            raise refusal(ParameterErrorNumber.INCORRECT_DATA_TYPE, parameter)
        return parameter

    def _load_cache(self, task: Pkw) -> Pkw:
        """Task 11: the answer's length is the number of characters."""
        parameter = self._text(task.pnu)
        characters = bytes(self._store.read(task.pnu, 0, parameter.elements))
        self._cache = characters.partition(b"\0")[0][: task.length]
        return replace(task, length=len(self._cache), value=0)

    def _read_cache(self, task: Pkw) -> Pkw:
        """Task 12: four octets from a place on; the length says how many are valid from there on."""
        rest = self._cache[self._start(task) :]
        value = int.from_bytes(rest[:STEP].ljust(STEP, b"\0"), "big")
        return replace(task, pnu=0, length=len(rest), value=value)

    def _write_cache(self, task: Pkw) -> Pkw:
        """Task 9: four octets to a place; the length is that of the whole string with the 0 at its end."""
        start = self._start(task)
        given = task.value.to_bytes(STEP, "big")[: max(task.length - start, 0)]
        self._cache = (self._cache[:start].ljust(start, b"\0") + given + self._cache[start + len(given) :])[
            :CACHE_OCTETS
        ]
        return replace(task, pnu=0)

    def _store_cache(self, task: Pkw) -> Pkw:
        """Task 10: so many octets of the cache, of which the last must be 0, become the parameter's text."""
        parameter = self._text(task.pnu)
        text, end, _ = self._cache[: task.length].partition(b"\0")
        if not end:
            raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter)
        if len(text) > parameter.elements:
            raise refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter)
        self._store.write(task.pnu, 0, list(text.ljust(parameter.elements, b"\0")))
        return replace(task, value=0)
