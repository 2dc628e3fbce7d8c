"""The login page, shown until a browser has given the farm's token.

It shows nothing about the farm.  The token is sent as a form, so that it does not appear in a URL.
"""

from __future__ import annotations

import base64
import hashlib
import html
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

import anyio
from starlette.responses import HTMLResponse

from pnfarm.web.bodies import read_octets
from pnfarm.web.errors import ClientGoneError, TooLargeError

if TYPE_CHECKING:
    from starlette.requests import Request

__all__ = ["login_page", "typed_token"]

#: Octets of a form; a token has at most 512.
MAX_FORM = 4096
#: How long the farm waits for it: a browser sends it at once.
FORM_SECONDS = 2.0
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
<p>This farm needs its token. The farm's log names the file at the start (<code>api listening</code>);
in the container rig, <code>docker compose exec farm cat /run/pnfarm/token</code> prints it.</p>
<form method="post" action="/">
<label>Token <input name="token" type="password" autocomplete="current-password" autofocus required></label>
<button>Open</button></form>
<p class="bad" role="alert">{alert}</p></body></html>
"""


def login_page(alert: str = "") -> HTMLResponse:
    """``alert``: what is wrong with the token that was shown, as plain text."""
    digest = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:; base-uri 'none'; form-action 'self'; "
        "frame-ancestors 'none'"
    )
    return HTMLResponse(
        _PAGE.format(style=_STYLE, alert=html.escape(alert)),
        HTTPStatus.FORBIDDEN if alert else HTTPStatus.OK,
        headers={"Content-Security-Policy": policy, "X-Content-Type-Options": "nosniff", "Cache-Control": "no-store"},
    )


async def typed_token(request: Request) -> str:
    """The token in the submitted form; empty if the body is not such a form."""
    try:
        with anyio.move_on_after(FORM_SECONDS):
            body = await read_octets(request, MAX_FORM)
            return parse_qs(body.decode("ascii")).get("token", [""])[0].strip()
    except (TooLargeError, ClientGoneError, ValueError):
        pass
    return ""
