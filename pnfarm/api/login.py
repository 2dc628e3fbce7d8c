"""The page that asks a person for the farm's token, in place of the farm's own.

It tells nothing of the farm.  What is typed comes back as a form, so that the token stands in no address line.
"""

from __future__ import annotations

import base64
import hashlib
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse

if TYPE_CHECKING:
    from starlette.requests import Request

__all__ = ["login_page", "typed_token"]

#: Octets of a form; a token has at most 512.
MAX_FORM = 4096
_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 34rem; margin: 4rem auto; padding: 0 1rem; }
input, button { font: inherit; padding: .25rem .6rem; } input { width: 22rem; max-width: 100%; }
.bad { color: #d43; }
"""
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>pnfarm</title><link rel="icon" href="data:,"><style>{style}</style></head>
<body><h1>pnfarm</h1>
<p>This farm asks for its token. Its log says where that lies when it starts (<code>api listening</code>);
in the rig of containers <code>docker compose exec farm cat /run/pnfarm/token</code> prints it.</p>
<form method="post" action="/">
<label>Token <input name="token" type="password" autocomplete="current-password" autofocus required></label>
<button>Open</button></form>
<p class="bad" role="alert">{alert}</p></body></html>
"""


def login_page(*, wrong: bool = False) -> HTMLResponse:
    """``wrong``: what was typed is not the token."""
    digest = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:; base-uri 'none'; form-action 'self'; "
        "frame-ancestors 'none'"
    )
    return HTMLResponse(
        _PAGE.format(style=_STYLE, alert="That is not its token." if wrong else ""),
        HTTPStatus.FORBIDDEN if wrong else HTTPStatus.OK,
        headers={"Content-Security-Policy": policy, "X-Content-Type-Options": "nosniff", "Cache-Control": "no-store"},
    )


async def typed_token(request: Request) -> str:
    """What the form brings; empty for anything that is no such form."""
    body = bytearray()
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > MAX_FORM:
                return ""
    except ClientDisconnect:
        return ""
    try:
        return parse_qs(body.decode("ascii")).get("token", [""])[0].strip()
    except ValueError:
        return ""
