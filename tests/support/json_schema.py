"""Whether a JSON value is what a JSON Schema describes (the words of draft 2020-12 that this project's schemas use)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

#: Words that say nothing about the value.
NOTES = {"title", "description", "default", "examples", "example"}
TYPES = {
    "object": dict, "array": list, "string": str, "boolean": bool, "null": type(None), "integer": int,
    "number": (int, float),
}  # fmt: skip


def wrongs(value: Any, schema: Mapping[str, Any], whole: Mapping[str, Any], place: str = "$") -> Iterator[str]:
    """What is wrong with it, each with its place; ``whole`` is the document that ``$ref`` is looked up in.

    Raises :class:`NotImplementedError` for a word that it does not know: no schema is checked in part.
    """
    for word, wanted in schema.items():
        match word:
            case "$ref":
                target: Any = whole
                for step in wanted.removeprefix("#/").split("/"):
                    target = target[step]
                yield from wrongs(value, target, whole, place)
            case "type":
                names = [wanted] if isinstance(wanted, str) else wanted
                if not any(_is(value, name) for name in names):
                    yield f"{place}: {value!r:.80} is no {' or '.join(names)}"
            case "anyOf":
                found = [list(wrongs(value, choice, whole, place)) for choice in wanted]
                if all(found):
                    yield f"{place}: none of {len(found)}: " + " | ".join(one[0] for one in found)
            case "enum":
                if value not in wanted:
                    yield f"{place}: {value!r:.80} is none of {wanted}"
            case "const":
                if value != wanted:
                    yield f"{place}: {value!r:.80} is not {wanted}"
            case "pattern":
                if isinstance(value, str) and not re.search(wanted, value):
                    yield f"{place}: {value!r:.80} does not match {wanted}"
            case "minimum":
                if isinstance(value, (int, float)) and value < wanted:
                    yield f"{place}: {value!r:.80} is below {wanted}"
            case "items":
                for number, item in enumerate(value if isinstance(value, list) else ()):
                    yield from wrongs(item, wanted, whole, f"{place}[{number}]")
            case "required":
                yield from (f"{place}: no {name}" for name in wanted if isinstance(value, dict) and name not in value)
            case "properties" | "additionalProperties":
                pass
            case _ if word not in NOTES:
                raise NotImplementedError(f"{place}: {word}")
    if isinstance(value, dict):
        known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
        for name, item in value.items():
            below = known.get(name, others)
            if below is False:
                yield f"{place}: {name} is not described"
            elif below is not True:
                yield from wrongs(item, below, whole, f"{place}.{name}")


def _is(value: Any, name: str) -> bool:
    # JSON's true is no number, although Python's is
    return isinstance(value, TYPES[name]) and (name == "boolean" or not isinstance(value, bool))
