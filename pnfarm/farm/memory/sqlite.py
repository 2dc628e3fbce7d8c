"""The drives' non-volatile memory: one SQLite file in the farm's state folder.

One row for each key of a station's values (name, IP parameters, drive parameters, fault history, I&M data ...), JSON.
A station is saved in one transaction in write-ahead mode: a process killed at any moment leaves either what was
saved before or what was saved last.  A file that is damaged, or is not pnfarm's, is refused and never written to.
"""

from __future__ import annotations

import sqlite3
import threading
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.memory.rows import rows_of, values_of

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FILE_NAME", "FarmState"]

#: The file in the state folder.
FILE_NAME = "drives.sqlite3"

#: "pnfa" in SQLite's header identifies the file as ours.
_APPLICATION_ID = 0x706E6661
_VERSION = 1
_SCHEMA = """
CREATE TABLE memory (
    station TEXT NOT NULL,
    key TEXT NOT NULL,
    value TEXT NOT NULL,
    PRIMARY KEY (station, key)
) WITHOUT ROWID
"""
#: How long a save waits for another process that reads the file, seconds.
_BUSY_SECONDS = 2.0


class FarmState:
    """Non-volatile memory of a farm's stations; a :class:`pnfarm.drives.parameters.memory.NonVolatile`.

    ``directory`` is the state folder, made when it is missing; None keeps everything in memory.  Values are
    dicts with text keys; below them None, bool, int, float, str, bytes, lists and dicts with text or whole numbers
    as keys come back equal.  Safe to use from several threads.
    Raises :class:`EnvironmentError_` when the file cannot be used, now or later.
    """

    def __init__(self, directory: str | Path | None) -> None:
        self.file = Path(directory) / FILE_NAME if directory is not None else None
        self._lock = threading.Lock()
        #: By station, the rows that the file does not have yet.
        self._held: dict[str, list[tuple[str, str]]] = {}
        with self._explained("open"):
            if self.file is not None:
                self.file.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(
                str(self.file) if self.file is not None else ":memory:",
                timeout=_BUSY_SECONDS,
                isolation_level=None,
                check_same_thread=False,
            )
        try:
            with self._explained("open"):
                self._prepare()
        except EnvironmentError_:
            self._connection.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the file; a closed state refuses everything."""
        if self._held:
            # what cannot be written now is lost, as the log has reported
            with suppress(EnvironmentError_):
                self._write({})
        with self._lock:
            self._connection.close()

    def stations(self) -> list[str]:
        """Stations with stored values, in alphabetical order."""
        with self._lock, self._explained("read"):
            rows = self._connection.execute("SELECT DISTINCT station FROM memory ORDER BY station").fetchall()
        return [station for (station,) in rows]

    def load(self, station: str) -> dict[str, Any] | None:
        """What was saved last for this station, None if nothing ever was."""
        with self._lock, self._explained("read"):
            rows = self._connection.execute("SELECT key, value FROM memory WHERE station = ?", (station,)).fetchall()
            rows = self._held.get(station, rows)
        if not rows:
            return None
        return values_of(rows, station, self.damaged)

    def save(self, station: str, values: dict[str, Any]) -> None:
        """Replace what is kept for this station.  TypeError for values that this memory cannot keep."""
        self._write({station: rows_of(values)})

    def _write(self, rows: dict[str, list[tuple[str, str]]]) -> None:
        """The rows of these stations, and of those that are held."""
        with self._transaction("write"):
            held = dict(self._held)
            for station, its in {**held, **rows}.items():
                self._connection.execute("DELETE FROM memory WHERE station = ?", (station,))
                self._connection.executemany("INSERT INTO memory VALUES (?, ?, ?)", [(station, *row) for row in its])
        with self._lock:
            # what another thread held meanwhile is newer
            self._held = {station: its for station, its in self._held.items() if its is not held.get(station)}

    def hold(self, station: str, values: dict[str, Any]) -> None:
        """See :meth:`pnfarm.drives.parameters.memory.NonVolatile.hold`: the next save of any, or the end, writes it."""
        with self._lock:
            self._held[station] = rows_of(values)

    @property
    def ready(self) -> bool:
        """Whether it is worth trying: what a folder has no room for now it may have in a moment."""
        return True

    def delete(self, station: str) -> None:
        """Delete a station's values: it starts as from the factory."""
        with self._transaction("write"):
            self._held.pop(station, None)
            self._connection.execute("DELETE FROM memory WHERE station = ?", (station,))

    # --- the file -----------------------------------------------------------------------------------------------

    def _prepare(self) -> None:
        run = self._connection.execute
        # read only, until the file proves to be valid and ours
        (report,) = run("PRAGMA quick_check(1)").fetchone()
        if report != "ok":
            raise self.damaged(report)
        (application,) = run("PRAGMA application_id").fetchone()
        (version,) = run("PRAGMA user_version").fetchone()
        (tables,) = run("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != _APPLICATION_ID:
            raise EnvironmentError_(
                f"{self.file} is a database of another program; give the farm another `state` folder"
            )
        if version > _VERSION:
            raise EnvironmentError_(
                f"{self.file} was written by a newer pnfarm (format {version}, this one reads {_VERSION}); "
                "update pnfarm or give the farm another `state` folder"
            )
        run("PRAGMA journal_mode = WAL")
        # with WAL: a killed process loses nothing, a power cut at most the last save, and neither harms the file
        run("PRAGMA synchronous = NORMAL")
        if not tables:
            run("BEGIN IMMEDIATE")
            # another process may have been faster
            if not run("SELECT count(*) FROM sqlite_master").fetchone()[0]:
                run(_SCHEMA)
                run(f"PRAGMA application_id = {_APPLICATION_ID}")
                run(f"PRAGMA user_version = {_VERSION}")
            run("COMMIT")

    @contextmanager
    def _transaction(self, verb: str) -> Iterator[None]:
        with self._lock, self._explained(verb):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    @contextmanager
    def _explained(self, verb: str) -> Iterator[None]:
        """SQLite's and the system's errors as one sentence with a remedy."""
        try:
            yield
        except sqlite3.OperationalError as error:
            hint = "see that its folder can be written and has room, and that no other farm uses it"
            raise EnvironmentError_(f"cannot {verb} the drives' memory {self.file}: {error}; {hint}") from error
        except sqlite3.ProgrammingError as error:
            raise EnvironmentError_(f"cannot {verb} the drives' memory {self.file}: it is closed already") from error
        except sqlite3.DatabaseError as error:
            raise self.damaged(str(error)) from error
        except OSError as error:
            place = self.file.parent if self.file is not None else None
            raise EnvironmentError_(f"cannot {verb} the state folder {place}: {error.strerror}") from error

    def damaged(self, detail: str) -> EnvironmentError_:
        """What to raise for a memory that cannot be used as it is."""
        return EnvironmentError_(
            f"the drives' memory {self.file} is damaged: {detail}; it was left as it is - "
            "restore a copy, or move it away and the drives start as from the factory"
        )
