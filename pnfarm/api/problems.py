"""Errors as problem documents (RFC 9457, ``application/problem+json``), with the message of the command line.

``title`` is the status's phrase and ``type`` stays ``about:blank`` (RFC 9457, 4.2.1); details for programs
are in separate members: ``error_number`` (PROFIdrive) and ``errors`` (field by field).
"""

from __future__ import annotations

import traceback
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import structlog
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match

from pnfarm.drives.axis_handle import CommandRingFullError
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.errors import ConfigError, EnvironmentError_, FieldsError, PnfarmError
from pnfarm.web.bodies import Json
from pnfarm.web.errors import ClientGoneError, RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fastapi import FastAPI
    from fastapi.exceptions import RequestValidationError
    from starlette.requests import Request
    from starlette.responses import Response

__all__ = ["install_handlers", "problem"]

logger = structlog.get_logger("pnfarm.api")

#: Key in the scope of a request whose error has been answered and logged.
REPORTED = "pnfarm.reported"
#: Characters of a path, and of the end of a traceback, that are logged.
MAX_LOGGED, MAX_TRACE = 200, 8000


class ProblemResponse(Json):
    media_type = "application/problem+json"


def problem(
    status: int, detail: str, request: Request, *, headers: Mapping[str, str] | None = None, **members: Any
) -> Response:
    """A problem document; ``detail`` is a sentence that says what is wrong."""
    content = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
        "instance": request.scope["path"],
        **members,
    }
    return ProblemResponse(content, status, headers=dict(headers or {}))


#: HTTP status of a refused parameter access; every other number is a 422.
_PARAMETER_STATUS = {
    ParameterErrorNumber.IMPERMISSIBLE_PNU: HTTPStatus.NOT_FOUND,
    ParameterErrorNumber.FAULTY_SUBINDEX: HTTPStatus.NOT_FOUND,
    ParameterErrorNumber.NO_ARRAY: HTTPStatus.NOT_FOUND,
    ParameterErrorNumber.NOT_CHANGEABLE: HTTPStatus.CONFLICT,
    ParameterErrorNumber.NO_OPERATION_PRIORITY: HTTPStatus.CONFLICT,
    ParameterErrorNumber.OPERATING_STATE: HTTPStatus.CONFLICT,
}


def _parameter_status(number: int) -> HTTPStatus:
    return next((s for known, s in _PARAMETER_STATUS.items() if known == number), HTTPStatus.UNPROCESSABLE_ENTITY)


def _pnfarm_error(request: Request, exc: Exception) -> Response:
    """The HTTP status for an error, by its type."""
    sentence = str(exc)
    match exc:
        case ParameterError():
            return problem(_parameter_status(exc.number), sentence, request, error_number=exc.number)
        case FieldsError():
            errors = [{"field": field, "what": what, "allowed": allowed} for field, what, allowed in exc.issues]
            sentence = sentence.replace("\n", "; ")
            return problem(HTTPStatus.UNPROCESSABLE_ENTITY, sentence, request, errors=errors)
        case ClientGoneError():
            return _gone(request)
        case RequestError():
            members: dict[str, Any] = {"errors": exc.errors} if exc.errors else {}
            return problem(exc.status, sentence, request, **members)
        case ConfigError():
            return problem(HTTPStatus.UNPROCESSABLE_ENTITY, sentence, request)
        case EnvironmentError_() | CommandRingFullError():
            return problem(HTTPStatus.SERVICE_UNAVAILABLE, sentence, request)
        case _:
            return _internal(request, exc)


def _gone(request: Request) -> Response:
    """Log one line; the response goes to a client that has gone."""
    client = request.client.host if request.client is not None else ""
    logger.info("client hung up", path=request.scope["path"][:MAX_LOGGED], client=client)
    return problem(HTTPStatus.BAD_REQUEST, "the client hung up", request)


def _internal(request: Request, exc: Exception) -> Response:
    request.scope[REPORTED] = True
    if isinstance(exc, ClientDisconnect) or isinstance(exc.__context__, ClientDisconnect):
        return _gone(request)
    # as text: a pretty traceback shows local variables, and takes seconds
    trace = "".join(traceback.format_exception(exc))[-MAX_TRACE:]
    logger.error("internal error", path=request.scope["path"][:MAX_LOGGED], traceback=trace)
    sentence = f"internal error: {type(exc).__name__}; see the farm's log"
    return problem(HTTPStatus.INTERNAL_SERVER_ERROR, sentence, request)


def _allowed_methods(request: Request) -> list[str]:
    """Methods of every route with this path."""
    found: set[str] = set()
    for route in request.app.routes:
        match, _ = route.matches(request.scope)
        if match is not Match.NONE:
            found |= set(getattr(route, "methods", None) or ())
    return sorted(found)


def _http_error(request: Request, exc: Exception) -> Response:
    assert isinstance(exc, HTTPException)
    path = request.scope["path"]
    if exc.status_code == HTTPStatus.NOT_FOUND:
        return problem(404, f"no such path: {path}; /openapi.json lists all", request)
    if exc.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        allowed = ", ".join(_allowed_methods(request))
        sentence = f"{request.method} is not possible on {path}; allowed: {allowed}"
        return problem(405, sentence, request, headers={"Allow": allowed})
    return problem(exc.status_code, str(exc.detail), request, headers=exc.headers)


def _validation_error(request: Request, exc: Exception) -> Response:
    found: RequestValidationError = exc  # type: ignore[assignment]  # the handler is installed for this type alone
    errors = [
        {"field": ".".join(str(step) for step in error["loc"][1:]) or str(error["loc"][0]), "what": error["msg"]}
        for error in found.errors()
    ]
    sentence = "; ".join(f"{error['field']}: {error['what']}" for error in errors)
    return problem(HTTPStatus.UNPROCESSABLE_ENTITY, sentence, request, errors=errors)


def install_handlers(app: FastAPI) -> None:
    """Make every error of ``app`` a problem document."""
    from fastapi.exceptions import RequestValidationError  # noqa: PLC0415 - needed to install, not to describe

    app.add_exception_handler(PnfarmError, _pnfarm_error)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(Exception, _internal)
