"""``pnfarm tls``: an authority of one's own, and certificates for the API."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.terminal.output import print_line
from pnfarm.terminal.settings import help_without_command

__all__ = ["app"]

app = typer.Typer(help="Certificates for `pnfarm up --tls-cert` and `pnfarm hub --tls-cert`.")
app.callback(invoke_without_command=True)(help_without_command)


@app.command("init")
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the files.", show_default=False)],
    host: Annotated[
        list[str] | None,
        typer.Option(
            "--host",
            metavar="NAME",
            help="Name or address by which clients reach the API, besides localhost.  Repeatable; left out, those of "
            "the last certificate, or this machine's name.",
            show_default=False,
        ),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=825, help="Days for which the certificate is valid.")] = 397,
) -> None:
    """Make an authority, and a certificate by it for the API; where there is an authority, only a new certificate.

    ca.pem is for clients (`--tls-ca`), server.pem and server.key are for the farm. Keep ca.key secret:
    with it, anybody can pose as the farm.  Needs cryptography: pip install 'pnfarm[tls]'.
    """
    try:
        from pnfarm.api.access.authority import make_certificate
    except ModuleNotFoundError as exc:
        raise EnvironmentError_("pnfarm tls needs cryptography: pip install 'pnfarm[tls]'") from exc

    made = make_certificate(folder, host or [], days)
    print_line(
        f"{'made' if made.is_new else 'kept'} the authority {made.authority}, until {made.authority_ends:%Y-%m-%d}"
    )
    print_line(f"made the certificate {made.certificate} for {', '.join(made.names)}, until {made.ends:%Y-%m-%d}")
    print_line(f"pnfarm up FILE --tls-cert {made.certificate} --tls-key {made.key}")
    print_line(f"pnfarm inspect --api https://{made.names[0]}:8702 --tls-ca {made.authority}")
