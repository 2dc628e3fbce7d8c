"""The type of an error, and which operation answers which."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, Field

from pnfarm.web.bodies import Schema

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["PROBLEMS", "Problem", "problems_of"]


class FieldError(Schema):
    """One field of a body."""

    field: str
    what: str
    allowed: str = ""
    line: str = Field(default="", description="Of a scenario's text.")


class Problem(BaseModel):
    """RFC 9457."""

    type: str = Field(description="Always about:blank; see the title.")
    title: str = Field(description="The status's phrase.")
    status: int
    detail: str = Field(description="What is wrong and what would be right, one sentence.")
    instance: str = Field(description="The path.")
    error_number: int | None = Field(default=None, description="PROFIdrive's error number of a refused parameter.")
    errors: list[FieldError] | None = Field(default=None, description="One entry for each wrong field.")


#: Error responses, merged into each operation's responses.
PROBLEMS: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "An error",
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
}

_PROBLEM = PROBLEMS["default"]["content"]
#: Status -> when it is answered.
_WHEN = {
    "401": "The token is missing, wrong or expired",
    "403": "Not permitted: the token's role is not enough, or a page of another origin",
    "404": "Nothing has this name, number or id",
    "409": "Not in the present state",
    "412": "It has changed since the ETag of If-Match",
    "422": "The request is wrong; `errors` says field by field what is allowed",
}


def problems_of(method: str, path: str, operation: Mapping[str, Any]) -> dict[str, Any]:
    """The error responses of an operation, by status; ``default`` stays for the rare ones, such as overload."""
    named = "{" in path or any(found["name"] == "drive" for found in operation.get("parameters", ()))
    found = ["401", "403"]
    if named:
        found.append("404")
    if named and (method != "get" or "/params/" in path or path.endswith("/report")):
        found.append("409")
    if "ETag" in str(operation["responses"]) and method != "get":
        found.append("412")
    if method != "get" or "parameters" in operation:
        found.append("422")
    return {status: {"description": _WHEN[status], "content": _PROBLEM} for status in found}
