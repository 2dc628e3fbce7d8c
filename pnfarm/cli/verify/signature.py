"""A signature of the report with the user's own key, by ``ssh-keygen -Y sign`` (OpenSSH 8.1; PROTOCOL.sshsig)."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, EnvironmentError_

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["NAMESPACE", "check_signing", "sign"]

#: A signature is valid for this purpose alone.
NAMESPACE = "pnfarm-verify"
_PROGRAM = "ssh-keygen"


def check_signing(key: Path) -> None:
    """Before a run of minutes.  Raises :class:`ConfigError` for the key, :class:`EnvironmentError_` for the program."""
    if not key.is_file() or not os.access(key, os.R_OK):
        raise ConfigError(f"--sign {key} is not a file that can be read; give a private key, such as ~/.ssh/id_ed25519")
    if shutil.which(_PROGRAM) is None:
        raise EnvironmentError_(f"--sign needs {_PROGRAM}, which is not installed; it belongs to OpenSSH's client")


def sign(file: Path, key: Path) -> Path:
    """Writes the signature beside the file, with ``.sig`` at the end of its name.

    Asks for the key's passphrase, if it has one.  Raises :class:`ConfigError` where the program refuses the key.
    """
    # by standard input, so that an older signature is replaced without a question
    with file.open("rb") as data:
        run = subprocess.run(
            [_PROGRAM, "-Y", "sign", "-f", str(key), "-n", NAMESPACE], stdin=data, capture_output=True, check=False
        )
    if run.returncode != 0:
        why = run.stderr.decode("utf-8", "replace").strip().splitlines()
        raise ConfigError(f"{key} cannot sign {file}: {why[-1] if why else f'{_PROGRAM} failed'}")
    signature = file.with_name(f"{file.name}.sig")
    try:
        signature.write_bytes(run.stdout)
    except OSError as exc:
        raise EnvironmentError_(f"{signature} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    return signature
