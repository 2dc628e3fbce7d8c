"""A station's non-volatile memory as rows of a database: a key and JSON for each of its values."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.errors import EnvironmentError_

__all__ = ["rows_of", "values_of"]

# JSON has no octets and no numbers as keys; these wrap them.
_OCTETS = "$octets"
_PAIRS = "$pairs"


def rows_of(values: dict[str, Any]) -> list[tuple[str, str]]:
    """The rows of a station.  TypeError for values that no memory can keep.

    The first row, without a key, says that there is a memory, also if it is empty.
    """
    rows = [("", "null")]
    for key, value in values.items():
        if not isinstance(key, str) or not key:
            raise TypeError(f"a key of a station's memory is a word, not {key!r}")
        rows.append((key, json.dumps(_to_json(value), ensure_ascii=True)))
    return rows


def values_of(
    rows: Iterable[tuple[str, str]], station: str, damaged: Callable[[str], EnvironmentError_]
) -> dict[str, Any]:
    """The values of a station's rows; raises what ``damaged`` makes of a sentence."""
    values: dict[str, Any] = {}
    for key, text in rows:
        if key == "":
            continue
        try:
            values[key] = _from_json(json.loads(text))
        except (ValueError, TypeError, RecursionError) as error:
            raise damaged(f"the value {key!r} of station {station!r} is not JSON ({error})") from error
    return values


def _to_json(value: Any) -> Any:
    match value:
        case None | bool() | int() | float() | str():
            return value
        case bytes():
            return {_OCTETS: value.hex()}
        case list() | tuple():
            return [_to_json(item) for item in value]
        case dict():
            if all(isinstance(key, str) for key in value) and not value.keys() & {_OCTETS, _PAIRS}:
                return {key: _to_json(item) for key, item in value.items()}
            if all(type(key) in {str, int} for key in value):
                return {_PAIRS: [[key, _to_json(item)] for key, item in value.items()]}
    raise TypeError(f"a station's memory cannot keep a {type(value).__name__}: {value!r}")


def _from_json(value: Any) -> Any:
    match value:
        case {"$octets": str(text)}:
            return bytes.fromhex(text)
        case {"$pairs": list(pairs)}:
            return {key: _from_json(item) for key, item in pairs}
        case dict():
            return {key: _from_json(item) for key, item in value.items()}
        case list():
            return [_from_json(item) for item in value]
        case _:
            return value
