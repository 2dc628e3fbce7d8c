"""JSON bodies of requests and responses."""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, TypeVar

from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, ValidationError
from starlette.requests import ClientDisconnect

from pnfarm.web.errors import ClientGoneError, RequestError, TooLargeError

if TYPE_CHECKING:
    from starlette.requests import Request

__all__ = ["MAX_BODY", "PREFIX", "Json", "Schema", "body_of", "checked", "read_object", "read_octets"]

#: Prefix of every path of this version of the API.
PREFIX = "/api/v1"
#: Largest body in octets; a fault needs a few hundred.
MAX_BODY = 65_536


class Schema(BaseModel):
    """Base of body types: no unknown members, no type conversions."""

    model_config = ConfigDict(extra="forbid", strict=True)


_S = TypeVar("_S", bound=Schema)


class Json(JSONResponse):
    """JSON in ASCII, so that any text of a request can be quoted in a response."""

    def render(self, content: Any) -> bytes:
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode()


def body_of(schema: type[Schema] | dict[str, Any], **examples: Any) -> dict[str, Any]:
    """How OpenAPI describes a body that a handler reads itself: its type or JSON Schema, and examples by name."""
    content: dict[str, Any] = {"schema": schema if isinstance(schema, dict) else schema.model_json_schema()}
    if examples:
        content["examples"] = {name: {"value": value} for name, value in examples.items()}
    return {"requestBody": {"required": True, "content": {"application/json": content}}}


def checked(body: dict[str, Any], schema: type[_S], *, allowed: str = "", hint: str) -> _S:
    """A body as its type; raises :class:`RequestError` with an entry for each wrong field.

    ``allowed`` is given with each wrong field, ``hint`` ends the message that names them all.
    """
    try:
        return schema.model_validate(body)
    except ValidationError as exc:
        errors = [
            {"field": ".".join(map(str, error["loc"])), "what": error["msg"], "allowed": allowed}
            for error in exc.errors(include_url=False)
        ]
        sentence = "; ".join(f"{error['field']}: {error['what']}" for error in errors)
        raise RequestError(f"{sentence}; {hint}", errors) from exc


async def read_octets(request: Request, most: int) -> bytes:
    """The request's body; raises :class:`TooLargeError` or :class:`ClientGoneError`."""
    body = bytearray()
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > most:
                raise TooLargeError(f"the body has more than {most} octets; no request needs more")
    except ClientDisconnect as exc:
        raise ClientGoneError("the client hung up before its request was complete") from exc
    return bytes(body)


async def read_object(request: Request) -> dict[str, Any]:
    """The request's body, a JSON object; raises :class:`RequestError` or :class:`TooLargeError`."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise RequestError(
            f"the body is {kind or 'of no stated type'}; send Content-Type: application/json",
            status=HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
        )
    body = await read_octets(request, MAX_BODY)
    try:
        value = json.loads(body)
    except RecursionError as exc:
        raise RequestError("the body is nested too deeply", status=HTTPStatus.BAD_REQUEST) from exc
    except ValueError as exc:
        # also raised for a number with too many digits for Python, and for octets that are not UTF-8
        raise RequestError(f"the body is not JSON: {exc}", status=HTTPStatus.BAD_REQUEST) from exc
    if not isinstance(value, dict):
        raise RequestError('the body is not a JSON object such as {"value": 1}')
    return value
