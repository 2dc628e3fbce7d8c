"""Errors of requests; the API turns each into a problem document (RFC 9457)."""

from __future__ import annotations

from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["ClientGoneError", "NotFoundError", "RequestError", "TooLargeError", "named_by_path"]


class RequestError(ConfigError):
    """A request that is not valid; ``errors`` lists each wrong field and what is allowed."""

    status = HTTPStatus.UNPROCESSABLE_ENTITY

    def __init__(
        self, sentence: str, errors: list[dict[str, str]] | None = None, *, status: HTTPStatus | None = None
    ) -> None:
        super().__init__(sentence)
        self.errors = errors or []
        if status is not None:
            self.status = status


class NotFoundError(RequestError):
    """The path names something that does not exist."""

    status = HTTPStatus.NOT_FOUND


@contextmanager
def named_by_path() -> Iterator[None]:
    """What is unknown in this block is what the path names: a :class:`ConfigError` becomes a :class:`NotFoundError`."""
    try:
        yield
    except ConfigError as exc:
        raise NotFoundError(str(exc)) from exc


class TooLargeError(RequestError):
    """A body larger than any request needs."""

    status = HTTPStatus.REQUEST_ENTITY_TOO_LARGE


class ClientGoneError(ConfigError):
    """The client hung up before its request was complete."""
