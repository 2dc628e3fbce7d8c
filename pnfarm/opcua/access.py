"""Who may do what: as the API has it, everybody on this machine where no user is named.

With a user, others on this machine may read, unless there is a user for that, too; beyond loopback everybody is one of
the two, over an encrypted channel.
"""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING, Any

from asyncua.crypto.permission_rules import User, UserRole

from pnfarm.errors import EnvironmentError_
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from pnfarm.config.opcua import OpcUa
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["Access", "password_of"]

_MOST = 4096


def password_of(config: FarmConfig, section: OpcUa) -> str | None:
    """The password of the user who may write; raises :class:`EnvironmentError_` for a file that holds none."""
    if section.password_file is None:
        return section.password
    file = config.beside(section.password_file)
    try:
        text = read_regular(file, _MOST).decode("utf-8", "replace").strip("\r\n")
    except OSError as exc:
        raise EnvironmentError_(f"the password's file {file}: {(exc.strerror or str(exc)).lower()}") from exc
    if not 8 <= len(text) <= 512 or "\n" in text:
        raise EnvironmentError_(f"the password's file {file} holds no password: 8 to 512 characters in one line")
    return text


class Access:
    """asyncua's user manager; see the module's docstring."""

    def __init__(self, section: OpcUa, password: str | None) -> None:
        self._writer = section.user
        self._passwords = {
            name: word
            for name, word in ((section.user, password), (section.read_user, section.read_password))
            if name is not None and word is not None
        }
        self.anonymous = section.is_loopback and section.read_user is None

    def may_write(self, name: str | None) -> bool:
        """Whether the user of this name, None for an anonymous one, may change something."""
        return name == self._writer

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """The user, or None for one who is not let in."""
        del iserver, certificate
        if username is None:
            return User(UserRole.User) if self.anonymous else None
        known = self._passwords.get(username)
        right = hmac.compare_digest((known or "").encode(), (password or "").encode())
        return User(UserRole.User, username) if right and known is not None else None
