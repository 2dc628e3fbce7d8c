"""The API's own description (OpenAPI), with the schemas of errors and of a stream's messages."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import anyio
import anyio.to_thread
from starlette.responses import Response

from pnfarm.api.schemas.device import ChangedSignals
from pnfarm.api.schemas.problem import Problem, problems_of

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.requests import Request

__all__ = ["add_description"]


def add_description(app: FastAPI) -> None:
    """``/openapi.json``, and ``app.openapi`` for what reads it in this process."""
    generate = app.openapi
    making = anyio.Lock()
    octets = b""

    def openapi() -> dict[str, Any]:
        described = app.openapi_schema
        if described is None:
            described = generate()
            schemas = described.setdefault("components", {}).setdefault("schemas", {})
            # no body is one of these
            for model in (Problem, ChangedSignals):
                schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
                schemas.update(schema.pop("$defs", {}))
                schemas[model.__name__] = schema
            for place, path in described["paths"].items():
                for method, operation in path.items():
                    # FastAPI's own 422 is of another form
                    operation["responses"].pop("422", None)
                    operation["responses"].update(problems_of(method, place, operation))
            schemas.pop("HTTPValidationError", None)
            schemas.pop("ValidationError", None)
            app.openapi_schema = described
        return described

    app.openapi = openapi  # type: ignore[method-assign]  # the documented way to extend the description

    async def describe(_: Request) -> Response:
        nonlocal octets
        async with making:
            if not octets:
                # it takes a second, for which drives and clients would wait
                octets = await anyio.to_thread.run_sync(lambda: json.dumps(openapi()).encode())
        return Response(octets, media_type="application/json")

    app.add_route("/openapi.json", describe, include_in_schema=False)
