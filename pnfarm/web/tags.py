"""ETags: an answer that the client has already, and a change that it makes on what it has seen (RFC 9110, 13)."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING

from pnfarm.web.errors import RequestError

if TYPE_CHECKING:
    from starlette.requests import Request

__all__ = ["check_match", "is_known"]


def check_match(request: Request, tag: str) -> None:
    """Raises :class:`RequestError` (412) where If-Match names another state than ``tag``."""
    wanted = request.headers.get("if-match")
    if wanted is not None and tag not in (tags := _tags(wanted)) and "*" not in tags:
        raise RequestError(
            f"it has changed since {wanted[:80]}: it is {tag} now; read it again, or send no If-Match",
            status=HTTPStatus.PRECONDITION_FAILED,
        )


def is_known(request: Request, tag: str) -> bool:
    """Whether If-None-Match names ``tag``: the client has this answer."""
    known = _tags(request.headers.get("if-none-match", ""))
    return tag in {one.removeprefix("W/") for one in known} or "*" in known


def _tags(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]
