"""What pnfarm has in a PostgreSQL database: its schema, and the statements on it.  Blocking; raises psycopg's errors.

The schema ``pnfarm`` holds several farms; other schemas are never touched.  A claim is one shard's right to run one
drive (:mod:`pnfarm.farm.lease`); whether it has expired, only the database's clock says.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Holder", "Owner", "Tables"]

_VERSION = 1
_SCHEMA = """
CREATE SCHEMA IF NOT EXISTS pnfarm;
CREATE TABLE pnfarm.format (version integer NOT NULL);
CREATE TABLE pnfarm.memory (
    farm text NOT NULL, station text NOT NULL, key text NOT NULL, value text NOT NULL,
    written timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (farm, station, key)
);
CREATE TABLE pnfarm.claim (
    farm text NOT NULL, station text NOT NULL,
    holder text NOT NULL, host text NOT NULL, shard text NOT NULL,
    since timestamptz NOT NULL, expires timestamptz NOT NULL,
    PRIMARY KEY (farm, station)
);
INSERT INTO pnfarm.format VALUES (1);
"""
_IS_THERE = """
SELECT to_regclass('pnfarm.format') IS NOT NULL,
       EXISTS (SELECT FROM pg_class JOIN pg_namespace ON pg_namespace.oid = relnamespace WHERE nspname = 'pnfarm')
"""
# one statement, so that it is whole or not at all; the claim's row is locked: no other process takes over meanwhile
_WRITE = """
WITH mine AS (
    SELECT FROM pnfarm.claim WHERE farm = %(farm)s AND station = %(station)s AND holder = %(holder)s FOR SHARE
), given AS (
    SELECT * FROM unnest(%(keys)s::text[], %(texts)s::text[]) AS row(key, value)
    WHERE %(holder)s::text IS NULL OR EXISTS (SELECT FROM mine)
), gone AS (
    DELETE FROM pnfarm.memory
    WHERE farm = %(farm)s AND station = %(station)s AND EXISTS (SELECT FROM given) AND key <> ALL (%(keys)s::text[])
)
INSERT INTO pnfarm.memory (farm, station, key, value)
SELECT %(farm)s, %(station)s, key, value FROM given
ON CONFLICT (farm, station, key) DO UPDATE SET value = excluded.value, written = clock_timestamp()
RETURNING key
"""
_READ = "SELECT station, key, value FROM pnfarm.memory WHERE farm = %s AND station = ANY (%s)"
_OTHERS = """
SELECT host, shard, max(extract(epoch FROM expires - clock_timestamp()))::float8 FROM pnfarm.claim
WHERE farm = %(farm)s AND station = ANY (%(stations)s) AND holder <> %(holder)s AND expires > clock_timestamp()
GROUP BY host, shard ORDER BY 3 DESC LIMIT 1
"""
_CLAIM = """
INSERT INTO pnfarm.claim AS claim (farm, station, holder, host, shard, since, expires)
SELECT %(farm)s, station, %(holder)s, %(host)s, %(shard)s, now(),
       clock_timestamp() + make_interval(secs => %(ttl)s)
FROM unnest(%(stations)s::text[]) AS station
ON CONFLICT (farm, station) DO UPDATE SET
    since = CASE WHEN claim.holder = excluded.holder THEN claim.since ELSE excluded.since END,
    holder = excluded.holder, host = excluded.host, shard = excluded.shard, expires = excluded.expires
RETURNING since
"""
_RELEASE = "DELETE FROM pnfarm.claim WHERE farm = %s AND holder = %s"


@dataclass(frozen=True, slots=True)
class Owner:
    """Who claims: ``holder`` is one process's own word."""

    holder: str
    host: str
    shard: str
    ttl_seconds: float


@dataclass(frozen=True, slots=True)
class Holder:
    """Who has claims of a drive that another wants, and for how long at least."""

    host: str
    shard: str
    seconds: float


class Tables:
    """One farm's part of a database, through an open connection of psycopg in autocommit mode."""

    def __init__(self, connection: Any, farm: str, stations: Sequence[str]) -> None:
        self._connection = connection
        self._farm = farm
        self._stations = list(stations)

    def prepare(self, where: str) -> None:
        """Make the schema where there is none.

        Raises :class:`EnvironmentError_` for one that this pnfarm cannot use.
        """
        with self._connection.transaction():
            self._lock("schema")
            known, others = self._connection.execute(_IS_THERE).fetchone()
            if others and not known:
                raise EnvironmentError_(
                    f"the schema pnfarm in {where} is another program's: give the farm another database as `state`"
                )
            if not known:
                self._connection.execute(_SCHEMA)
            (version,) = self._connection.execute("SELECT max(version) FROM pnfarm.format").fetchone()
        if version is None or version > _VERSION:
            raise EnvironmentError_(
                f"the schema pnfarm in {where} was written by a newer pnfarm (format {version}, this one reads "
                f"{_VERSION}): update pnfarm, or give the farm another database as `state`"
            )

    def alive(self) -> None:
        """Ask for nothing."""
        self._connection.execute("SELECT 1")

    def read(self) -> dict[str, list[tuple[str, str]]]:
        """The rows of every station that has some."""
        found: dict[str, list[tuple[str, str]]] = {}
        for station, key, text in self._connection.execute(_READ, (self._farm, self._stations)).fetchall():
            found.setdefault(station, []).append((key, text))
        return found

    def write(self, station: str, rows: Sequence[tuple[str, str]], owner: Owner | None) -> bool:
        """Replace a station's rows; False, with nothing changed, where its claim is not the owner's."""
        given = {
            "farm": self._farm,
            "station": station,
            "holder": None if owner is None else owner.holder,
            "keys": [key for key, _ in rows],
            "texts": [text for _, text in rows],
        }
        return bool(self._connection.execute(_WRITE, given).rowcount)

    def claim(self, owner: Owner) -> str | Holder:
        """Claim or renew every drive, or none; what names the period of holding, or who has one of them."""
        given = {
            "farm": self._farm,
            "stations": self._stations,
            "holder": owner.holder,
            "host": owner.host,
            "shard": owner.shard,
            "ttl": owner.ttl_seconds,
        }
        with self._connection.transaction():
            # one at a time, so that of two that want the same drives one gets them all
            self._lock(f"claims of {self._farm}")
            other = self._connection.execute(_OTHERS, given).fetchone()
            if other is not None:
                return Holder(*other)
            since = self._connection.execute(_CLAIM, given).fetchall()
        return str(max(moment for (moment,) in since))

    def release(self, owner: Owner) -> None:
        """Release every claim, so that no process has to wait for its end."""
        self._connection.execute(_RELEASE, (self._farm, owner.holder))

    def _lock(self, what: str) -> None:
        """Hold a word of pnfarm's own until the transaction ends."""
        digest = hashlib.blake2b(f"pnfarm {what}".encode(), digest_size=8).digest()
        self._connection.execute("SELECT pg_advisory_xact_lock(%s)", (int.from_bytes(digest, "big", signed=True),))
