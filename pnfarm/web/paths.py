"""How a path of the API is declared: method and path, what it answers, and a handler whose docstring is its summary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.web.bodies import PREFIX
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from fastapi import FastAPI

__all__ = ["ROLE_KEY", "Described", "Paths", "text"]

#: Of a route's description: the least role that may use it.
ROLE_KEY = "x-role"

_H = TypeVar("_H", bound="Callable[..., Any]")


@dataclass(frozen=True, slots=True)
class Described:
    """How OpenAPI describes a path: its summary, and by status the type of the body, or OpenAPI's words for it."""

    summary: str = ""
    answers: Mapping[int, Any] = field(default_factory=dict)


def text(media_type: str, schema: Mapping[str, str] | None = None) -> dict[int, Any]:
    """Answers that are no JSON."""
    return {200: {"content": {media_type: {"schema": schema or {"type": "string"}}}}}


class Paths:
    """The paths of one subject (``tag``) at ``app``.

    ``own`` has, by the name of a handler, what is described otherwise there.
    """

    def __init__(self, app: FastAPI, tag: str, own: Mapping[str, Described] | None = None) -> None:
        self._app = app
        self._tag = tag
        self._own = own or {}

    def __call__(
        self,
        where: str,
        answers: Any,
        *,
        role: Role | None = None,
        body: dict[str, Any] | None = None,
        outside: bool = False,
        **options: Any,
    ) -> Callable[[_H], _H]:
        """Declare ``METHOD path``, below the API's prefix unless it is ``outside``.

        ``answers``: the type of the body, or what there is by status, of which the first is the usual one.  ``body`` is
        OpenAPI's description of the request's, ``options`` are FastAPI's.  ``role`` is the least that may use it: a
        path that reads is for all, each other one names it.
        """
        method, _, path = where.partition(" ")
        least = Role.READ if role is None and method == "GET" else role
        if least is None:
            raise ValueError(f"{where} changes something and names no role")
        by_status = answers if isinstance(answers, dict) else {200: answers}

        def declare(handler: _H) -> _H:
            own = self._own.get(handler.__name__, Described())
            found = {**by_status, **own.answers}
            summary = own.summary or (handler.__doc__ or "").removesuffix(".")
            # FastAPI would show it a second time, as the description
            handler.__doc__ = None
            self._app.add_api_route(
                f"/{path}" if outside else f"{PREFIX}/{path}",
                handler,
                methods=[method],
                tags=[self._tag],
                summary=summary,
                status_code=next(iter(by_status)),
                responses={key: one if isinstance(one, dict) else {"model": one} for key, one in found.items()},
                openapi_extra={ROLE_KEY: least.value, **(body or {})},
                **options,
            )
            return handler

        return declare
