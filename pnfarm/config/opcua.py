"""The section `opcua` of a farm file: where the farm is served over OPC UA, and to whom."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from pnfarm.config.section import Section
from pnfarm.config.values import OFF, Duration, Listen, between, file_key, is_loopback, secret_key
from pnfarm.vocabulary.problem import Problem

__all__ = ["DEFAULT_OPCUA_LISTEN", "OpcUa", "open_opcua"]

#: IANA's port of OPC UA, on loopback.
DEFAULT_OPCUA_LISTEN = "127.0.0.1:4840"

_Interval = between(10_000_000, 60_000_000_000, "10ms to 60s")
_PEM = "in PEM or DER (`.der`), relative to this file."


def open_opcua(value: Any) -> Any:
    """The short forms: ``off``, ``on``, and an address alone."""
    if value is False or value == OFF:
        return None
    if value is True or value == "on":
        return {}
    return value if isinstance(value, (dict, OpcUa)) else {"listen": value}


class OpcUa(Section):
    """Where the drives, devices and the plant are served over OPC UA."""

    listen: Listen = Field(
        default=("127.0.0.1", 4840),
        description="HOST:PORT; port 0 takes any free one.",
        examples=[DEFAULT_OPCUA_LISTEN],
    )
    interval_ns: Annotated[Duration, _Interval] = Field(
        default=100_000_000,
        alias="interval",
        description="How often values that somebody reads or has subscribed to are read from the farm, at most.",
    )
    user: str | None = Field(
        default=None, min_length=1, max_length=64, description="User who may write; others on this machine may read."
    )
    password: str | None = secret_key("The user's password.")
    password_file: str | None = file_key("File with the password in its only line, relative to this file.")
    read_user: str | None = Field(
        default=None,
        min_length=1,
        max_length=64,
        description="Further user, who may read and change nothing; with it, every client needs a user.",
    )
    read_password: str | None = secret_key("That user's password.")
    certificate: str | None = file_key(f"Certificate of the server {_PEM}")
    key: str | None = file_key(f"Its private key {_PEM}")

    @model_validator(mode="after")
    def _is_safe(self) -> Self:
        if self.user is not None and (self.password is None) == (self.password_file is None):
            raise Problem("names a user", "either `password` or `password_file` with it")
        if self.user is None and (self.password, self.password_file, self.read_user) != (None, None, None):
            raise Problem("has a password or a read_user, and no user", "`user`, who may write")
        if (self.read_user is None) != (self.read_password is None):
            raise Problem("has one of read_user and read_password", "both of them")
        if self.user is not None and self.user == self.read_user:
            raise Problem("has one name for user and read_user", "another read_user")
        if (self.certificate is None) != (self.key is None):
            raise Problem("has one of certificate and key", "both of them")
        if not self.is_loopback and (self.user is None or self.certificate is None):
            raise Problem(
                "listens beyond loopback without a user and a certificate",
                f"`user`, its password, `certificate` and `key`; or an address of this machine alone, such as "
                f"{DEFAULT_OPCUA_LISTEN}",
            )
        return self

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return is_loopback(self.listen[0])
