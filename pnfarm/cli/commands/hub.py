"""``pnfarm hub``: one API for the farms of many machines."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from pnfarm.errors import ConfigError
from pnfarm.terminal.client import sendable, token_in
from pnfarm.terminal.output import print_line
from pnfarm.terminal.settings import setting, settings
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from pnfarm.api.access.tls import ServerTls
    from pnfarm.api.access.token_file import TokenFile
    from pnfarm.farm.file.sections import Api

__all__ = ["hub"]

_LISTEN = "127.0.0.1:8702"


@going_on_unread()
def hub(
    shard: Annotated[
        list[str] | None,
        setting(
            "--shard",
            "PNFARM_HUB_SHARD",
            "A farm's API, a URL or HOST:PORT.  Repeatable.",
            metavar="URL",
            show_default=False,
        ),
    ] = None,
    discover: Annotated[
        list[str] | None,
        setting(
            "--discover",
            "PNFARM_HUB_DISCOVER",
            "A name whose every address in DNS is a farm's; resolved again every 5 s.  Repeatable.",
            metavar="NAME:PORT",
            show_default=False,
        ),
    ] = None,
    api: Annotated[str, setting("--api", "PNFARM_HUB_API", "Address of the hub's API.", metavar="HOST:PORT")] = _LISTEN,
    token: Annotated[
        str | None,
        setting(
            "--api-token",
            "PNFARM_HUB_API_TOKEN",
            "Bearer token of the hub's API; beyond loopback one is generated and logged unless it is given.",
            metavar="TOKEN",
        ),
    ] = None,
    read_token: Annotated[
        str | None,
        setting(
            "--api-read-token",
            "PNFARM_HUB_API_READ_TOKEN",
            "Bearer token that may read and change nothing.",
            metavar="TOKEN",
        ),
    ] = None,
    tokens: Annotated[
        Path | None,
        setting("--tokens", "PNFARM_HUB_TOKENS", "File of tokens with roles (`pnfarm token`).", metavar="FILE"),
    ] = None,
    audit: Annotated[
        Path | None,
        setting("--audit", "PNFARM_HUB_AUDIT", "File of the audit log (`pnfarm audit`).", metavar="FILE"),
    ] = None,
    tls_cert: Annotated[
        Path | None,
        setting(
            "--tls-cert", "PNFARM_HUB_TLS_CERT", "Certificate of the hub's API, PEM: serve it by TLS.", metavar="FILE"
        ),
    ] = None,
    tls_key: Annotated[
        Path | None,
        setting(
            "--tls-key",
            "PNFARM_HUB_TLS_KEY",
            "The certificate's key, PEM; left out, it is in the certificate's file.",
            metavar="FILE",
        ),
    ] = None,
    tls_ca: Annotated[
        Path | None,
        setting(
            "--tls-ca",
            "PNFARM_HUB_TLS_CA",
            "Authority of the shards' certificates, PEM; left out, those of the system.  With it, discovered shards "
            "and addresses without http:// are asked by TLS.",
            metavar="FILE",
        ),
    ] = None,
    shard_token: Annotated[
        str | None,
        setting(
            "--shard-token",
            "PNFARM_HUB_SHARD_TOKEN",
            "Bearer token of the shards' APIs; or set PNFARM_HUB_SHARD_TOKEN_FILE to a file that holds it.",
            metavar="TOKEN",
        ),
    ] = None,
) -> None:
    """Serve the API of several farms as one, in the foreground until Ctrl-C (docs/hub.md).

    Options override environment variables: PNFARM_HUB_SHARD and PNFARM_HUB_DISCOVER (several values with spaces
    between them), PNFARM_HUB_API, PNFARM_HUB_API_TOKEN, PNFARM_HUB_API_READ_TOKEN, PNFARM_HUB_TOKENS, PNFARM_HUB_AUDIT,
    PNFARM_HUB_TLS_CERT, PNFARM_HUB_TLS_KEY, PNFARM_HUB_TLS_CA and PNFARM_HUB_SHARD_TOKEN; for the tokens also
    PNFARM_HUB_API_TOKEN_FILE, PNFARM_HUB_API_READ_TOKEN_FILE and PNFARM_HUB_SHARD_TOKEN_FILE.
    """
    import anyio

    from pnfarm.api.access.tls import ServerTls
    from pnfarm.api.access.token_file import TokenFile
    from pnfarm.hub.settings import api_of, name_of, url_of

    urls = list(dict.fromkeys(url_of(text, secure=tls_ca is not None) for text in shard or []))
    names = list(dict.fromkeys(name_of(text) for text in discover or []))
    if not urls and not names:
        raise ConfigError("no shard is given: add --shard URL for each farm, or --discover NAME:PORT")
    section = api_of(
        api, token or token_in("PNFARM_HUB_API_TOKEN_FILE"), read_token or token_in("PNFARM_HUB_API_READ_TOKEN_FILE")
    )
    if tls_key is not None and tls_cert is None:
        raise ConfigError("--tls-key is given without a certificate: add --tls-cert FILE")
    known = TokenFile(tokens) if tokens is not None else None
    tls = ServerTls(tls_cert, tls_key) if tls_cert is not None else None
    shards = _Shards(urls, names, sendable(shard_token) or sendable(token_in("PNFARM_HUB_SHARD_TOKEN_FILE")), tls_ca)
    anyio.run(_run, section, known, audit, tls, shards)


class _Shards(NamedTuple):
    """Where they are and how they are asked."""

    urls: list[str]
    names: list[tuple[str, int]]
    token: str | None
    ca: Path | None


async def _run(
    section: Api, tokens: TokenFile | None, audit: Path | None, tls: ServerTls | None, shards: _Shards
) -> None:
    import secrets

    import anyio

    from pnfarm.api import api_url, serve
    from pnfarm.api.access.audit import AuditLog, kept
    from pnfarm.cli.running import stop_on_signals
    from pnfarm.farm.events import ApiListening
    from pnfarm.farm.process.garbage import keep_what_is_loaded
    from pnfarm.hub import Hub, make_hub_app
    from pnfarm.hub.tasks import run_hub

    made = secrets.token_urlsafe(24) if section.needs_token and section.token is None and tokens is None else None
    hub = Hub(token=shards.token, ca=shards.ca)
    log = AuditLog(audit) if audit is not None else None
    app = make_hub_app(hub, token=section.token or made, read_token=section.read_token, tokens=tokens, audit=log)
    async with stop_on_signals() as running, kept(log, "hub"):
        with running:
            async with anyio.create_task_group() as tasks:
                await tasks.start(run_hub, hub, shards.urls, shards.names, app.state.views)
                host, port = await tasks.start(partial(serve, app, section.host, section.port, tls=tls))
                keep_what_is_loaded()
                url = api_url(host, port, secure=tls is not None)
                hub.record(ApiListening(url, token=made))
                if not settings.logs_json:
                    away = hub.shards.unreachable
                    print_line(
                        f"hub: {len(hub.shards.names)} drives of {len(hub.shards)} shards, {len(away)} unreachable, "
                        f"API {url}/"
                    )
                    for one in away:
                        print_line(f"  {one.label}: {one.reason}")
                    if sys.stdout.isatty():
                        print_line("Ctrl-C stops it.")
