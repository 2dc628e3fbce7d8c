"""Why a parser refuses octets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Callable


def reason(parse: Callable[[bytes], object], data: bytes) -> str | None:
    """The reason of the ``DecodeError``, None where there is none."""
    try:
        parse(data)
    except DecodeError as exc:
        return exc.reason
    return None
