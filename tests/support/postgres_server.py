"""A PostgreSQL server of a test's own: started, restarted, frozen, and gone at the end."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

import pytest

__all__ = ["Server", "started"]

_PLACES = "/usr/lib/postgresql"
#: A fixed word: it must not be seen anywhere.
PASSWORD = "geheim-4711"


def _programs() -> Path:
    found = sorted(Path(_PLACES).glob("*/bin/initdb"), key=lambda path: int(path.parts[-3].split(".")[0]))
    if not found:
        pytest.skip("needs PostgreSQL (package postgresql)")
    return found[-1].parent


class Server:
    """It listens on a unix socket in ``folder`` and on no network, whatever namespace asks."""

    def __init__(self, folder: Path) -> None:
        self._programs = _programs()
        self.folder = folder
        self._data = folder / "data"
        self._as: list[str] = []
        if os.geteuid() == 0:
            # it refuses to run as root
            user = next((name for name in ("postgres", "nobody") if _user(name)), None)
            setpriv = shutil.which("setpriv")
            if user is None or setpriv is None:
                pytest.skip("needs a user other than root to run PostgreSQL, and setpriv")
            entry = pwd.getpwnam(user)
            os.chown(folder, entry.pw_uid, entry.pw_gid)
            self._as = [setpriv, f"--reuid={entry.pw_uid}", f"--regid={entry.pw_gid}", "--clear-groups"]
        word = folder / "word"
        word.write_text(PASSWORD)
        word.chmod(0o644)
        self._run(
            "initdb", "-D", self._data, "-U", "farm", "--pwfile", word, "--auth", "scram-sha-256", "-N", "-E", "UTF8"
        )
        self.start()

    @property
    def url(self) -> str:
        return f"postgresql://farm:{PASSWORD}@/postgres?host={self.folder}"

    def _run(self, program: str, *arguments: object) -> None:
        done = subprocess.run(
            [*self._as, str(self._programs / program), *map(str, arguments)],
            cwd=self.folder, check=False, capture_output=True, text=True, timeout=60,
            env={"PATH": "/usr/bin:/bin", "LC_ALL": "C"},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr

    def start(self) -> None:
        options = f"-c listen_addresses='' -k {self.folder} -c fsync=off -c shared_buffers=1MB -c max_connections=20"
        self._run("pg_ctl", "-D", self._data, "-l", self.folder / "log", "-o", options, "-w", "start")

    def stop(self) -> None:
        """As a crash: no client is waited for."""
        self._run("pg_ctl", "-D", self._data, "-m", "immediate", "-w", "stop")

    def _processes(self) -> list[int]:
        first = int((self._data / "postmaster.pid").read_text().split()[0])
        children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
        return [first, *map(int, children)]

    def freeze(self) -> None:
        """No answer, and no end of any connection."""
        for number in self._processes():
            os.kill(number, signal.SIGSTOP)

    def thaw(self) -> None:
        for number in self._processes():
            os.kill(number, signal.SIGCONT)

    def ask(self, statement: str, *values: object) -> list[tuple]:
        psycopg = pytest.importorskip("psycopg")
        with psycopg.connect(self.url, autocommit=True) as connection:
            cursor = connection.execute(statement, values or None)
            return cursor.fetchall() if cursor.description else []

    def end(self) -> None:
        if (self._data / "postmaster.pid").exists():
            self.thaw()
            self.stop()


def _user(name: str) -> bool:
    try:
        pwd.getpwnam(name)
    except KeyError:
        return False
    return True


def started():
    """For a fixture."""
    # a folder of pytest's is not to be entered by others, and a socket's path is short
    folder = Path(tempfile.mkdtemp(prefix="pnpg"))
    server = None
    try:
        server = Server(folder)
        yield server
    finally:
        if server is not None:
            server.end()
        shutil.rmtree(folder, ignore_errors=True)
