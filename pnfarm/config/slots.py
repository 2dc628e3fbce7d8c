"""Keys and values of ``slots:``, in which a device's group says what is plugged: numbers, names of modules."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pydantic import PlainValidator, WithJsonSchema

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["named_module", "names_module", "slot_number"]


def slot_number(what: str, highest: int) -> tuple[PlainValidator, WithJsonSchema]:
    """A slot as the key of a mapping, whose keys YAML has as texts."""

    def read(value: Any) -> int:
        text = str(value)
        number = int(text) if re.fullmatch(r"[0-9]{1,5}", text) else -1
        if re.fullmatch(r"0[xX][0-9a-fA-F]{1,4}", text):
            number = int(text, 16)
        if not 0 <= number <= highest:
            raise Problem(f"{shown(value)} is not {what}", f"a number from 0 to {highest}")
        return number

    return PlainValidator(read), WithJsonSchema({"type": "integer", "minimum": 0, "maximum": highest})


def named_module(how: str) -> tuple[PlainValidator, WithJsonSchema]:
    """What a user calls a module; ``how``: ``name or number``."""
    return PlainValidator(_wanted_reader(how)), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer"}]})


def _wanted_reader(how: str) -> Callable[[Any], str | int]:
    def read(value: Any) -> str | int:
        if isinstance(value, bool) or not isinstance(value, str | int) or value == "":
            raise Problem(f"is {shown(value)}", f"the {how} of one that its file has")
        return value

    return read


def names_module(entry: object) -> bool:
    """Whether a slot's entry says what is plugged; one with parameters or submodules alone leaves it to the file."""
    return entry is None or getattr(entry, "module", None) is not None
