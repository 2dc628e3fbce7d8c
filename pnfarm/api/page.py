"""The web page: files of :file:`pnfarm/api/static`, read once, and what a browser may do with them.

The page's modules load nothing from elsewhere, and a page of another origin can neither show it nor call the API
(:mod:`pnfarm.api.access.guard`).
"""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass
from functools import cache
from http import HTTPStatus
from importlib import resources
from typing import TYPE_CHECKING

from starlette.requests import Request  # noqa: TC002 - FastAPI reads the annotations
from starlette.responses import Response

from pnfarm.web.errors import NotFoundError
from pnfarm.web.paths import ROLE_KEY
from pnfarm.web.roles import Role
from pnfarm.web.tags import is_known

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from importlib.resources.abc import Traversable

    from fastapi import FastAPI

__all__ = ["ASSETS", "add_page", "page_files", "policy"]

#: Where the page's files are, beside the page itself.
ASSETS = "/page/"
INDEX = "index.html"
_IMPORT_MAP = re.compile(rb'<script type="importmap">(.*?)</script>', re.DOTALL)
#: A browser asks each time whether its copy is good, so that no page is mixed of two versions.
_HEADERS = {
    "Cache-Control": "no-cache",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file with its type and its tag (RFC 9110, 8.8.3)."""

    content: bytes
    media_type: str
    tag: str


def _files(folder: Traversable, path: str = "") -> Iterator[tuple[str, bytes]]:
    for one in sorted(folder.iterdir(), key=lambda one: one.name):
        if one.is_dir():
            yield from _files(one, f"{path}{one.name}/")
        else:
            yield path + one.name, one.read_bytes()


@cache
def page_files() -> Mapping[str, PageFile]:
    """Files by their path below the page's folder; those of types that a page does not load are left out."""
    found = {}
    # a recording's own page has the same library in it
    shared = _files(resources.files("pnfarm.trace") / "uplot", "vendor/")
    for path, content in (*_files(resources.files("pnfarm.api") / "static"), *shared):
        media_type = _TYPES.get(path[path.rfind(".") :])
        if media_type is not None:
            found[path] = PageFile(content, media_type, f'"{hashlib.sha256(content).hexdigest()[:32]}"')
    return found


@cache
def policy() -> str:
    """What the page may load: its own files, and the names of its modules, which a browser takes from the page only."""
    found = _IMPORT_MAP.search(page_files()[INDEX].content)
    names = b"" if found is None else found[1]
    digest = base64.b64encode(hashlib.sha256(names).digest()).decode()
    return (
        f"default-src 'none'; script-src 'self' 'sha256-{digest}'; style-src 'self'; connect-src 'self'; "
        "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def _answer(request: Request, file: PageFile, headers: Mapping[str, str] | None = None) -> Response:
    sent = {**_HEADERS, "ETag": file.tag, **(headers or {})}
    if is_known(request, file.tag):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=sent)
    return Response(file.content, media_type=file.media_type, headers=sent)


def add_page(app: FastAPI) -> None:
    """``/`` and the files that it loads."""

    reads = {ROLE_KEY: Role.READ.value}

    @app.get("/", include_in_schema=False, openapi_extra=reads)
    async def page(request: Request) -> Response:
        return _answer(request, page_files()[INDEX], {"Content-Security-Policy": policy()})

    @app.get(ASSETS + "{path:path}", include_in_schema=False, openapi_extra=reads)
    async def asset(request: Request, path: str) -> Response:
        file = page_files().get(path)
        if file is None or path == INDEX:
            raise NotFoundError(f"the page has no file {path[:100]!r}")
        return _answer(request, file)
