"""The tokens that an API takes: the farm's own, the one that reads, and those of a file."""

from __future__ import annotations

import hmac
import time
from typing import TYPE_CHECKING

from pnfarm.api.access.token_file import Holder, digest_of
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.api.access.token_file import TokenFile

__all__ = ["Keys"]


class Keys:
    """``token`` may do everything, ``read_token`` reads; ``wall`` is seconds since 1970."""

    def __init__(
        self,
        token: str | None = None,
        read_token: str | None = None,
        file: TokenFile | None = None,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self._own = [
            Holder(name, role, digest_of(secret))
            for name, role, secret in (("token", Role.ADMIN, token), ("read_token", Role.READ, read_token))
            if secret is not None
        ]
        self._file = file
        self._wall = wall

    @property
    def needed(self) -> bool:
        """Whether a client must show one."""
        return bool(self._own) or self._file is not None

    async def follow(self) -> None:
        """Check whether the file has changed."""
        if self._file is not None:
            await self._file.follow()

    def holder(self, secret: str) -> Holder | None:
        """Whose secret it is, also one that has expired; all are compared, so that the time gives nothing away."""
        digest = digest_of(secret)
        found = None
        for holder in self._all():
            if hmac.compare_digest(holder.digest, digest):
                found = holder
        return found

    def is_good(self, holder: Holder) -> bool:
        """Whether it is still there, and has not expired."""
        return holder in self._all() and (holder.ends is None or self._wall() < holder.ends)

    def _all(self) -> list[Holder]:
        return self._own if self._file is None else [*self._own, *self._file.holders]
